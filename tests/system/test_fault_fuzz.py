"""Random bytes, messages, disconnects and faults, all mixed: no crash, no hang, no lost good frame.

CUBESTACK_FUZZ_EVENTS=1000000 makes as many events; the trace of a second run is the same to the
byte.
"""

import hashlib
import os
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.bus.i2c import I2cError, I2cMessage
from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.experiments.attitude import errors
from tests.system.conftest import Ear
from tests.tiers import quick

EVENTS = int(os.environ.get("CUBESTACK_FUZZ_EVENTS", "5000"))
CHECK_EVERY = 500
QUIET_S = 0.2
ANSWER_S = 0.5
LONGEST_STREAM_S = 3000  # some whole pictures of AraMiS, one after the other
READ_BYTES = 1 << 16
MOST_AT_ONCE = 10_000

#: Share of each kind of turn; one byte, one message, one disconnect or one fault is one event.
TURNS = {
    "noise": 0.25,
    "telemetry": 0.34,
    "command": 0.02,
    "i2c": 0.24,
    "i2c_noise": 0.01,
    "bench": 0.01,
    "disconnect": 0.06,
    "inject": 0.05,
    "clear": 0.02,
}
#: Faults that a board with such targets refuses all the same.
REFUSED = {"CubeStar": (), "CubeSense": (), "AraMiS": ("memory-stuck",)}

UPSETS = {"memory-upsets": 1e-7, "register-upsets": 0.05}


class Fuzzer:
    """Mistreats one board.

    Attributes:
        events: how many there were.
        trace: of all that came out of it, with its time, and of what reached the host.
    """

    def __init__(self, opened: AnyEmulated, seed: int, turns: dict[str, float] = TURNS) -> None:
        self.board: Board = opened.board
        self.interface = interface = opened.device.interface
        self.kernel = self.board.kernel
        self._step, self._then_ps, self._still = self.kernel.step, 0, 0
        vars(self.kernel)["step"] = self._watched_step
        self.rng = np.random.default_rng(seed)
        self.lines = {name: self.board.serial(name) for name in self.board.uarts}
        self.addresses = [interface.i2c_address]
        if interface.registers is not None:
            self.addresses.append(interface.registers.i2c_address)
        self.trace = hashlib.sha256()
        self.ears = [Ear(uart) for uart in self.board.uarts.values()]
        self.events = 0
        self.board.faults.seed = seed
        self.kinds = [
            kind
            for kind, fault in FAULTS.items()
            if self.board.faults.targets(fault.site) and kind not in REFUSED[interface.name]
        ]
        self.turns = [getattr(self, f"_{name}") for name in turns]
        self.shares = list(accumulate(turns.values()))
        self.steady = [m for m in interface.telemetries if m.supported and not m.has_side_effect]

    def run(self, events: int) -> tuple[int, str]:
        """Makes ``events`` events; returns the number of effective faults and the trace."""
        due = CHECK_EVERY
        while self.events < events:
            self.turns[np.searchsorted(self.shares, self.rng.random())]()
            self._listen(float(self.rng.exponential(0.002)))
            if self.events >= due:
                due = self.events + CHECK_EVERY
                self.check()
        self.check()
        return self.board.faults.events, self.trace.hexdigest()

    def _watched_step(self) -> None:
        """Fails if virtual time stops advancing."""
        self._step()
        now_ps = self.kernel.now
        self._still = self._still + 1 if now_ps == self._then_ps else 0
        self._then_ps = now_ps
        assert self._still < MOST_AT_ONCE, f"{MOST_AT_ONCE} things happen at {now_ps} ps"

    def check(self) -> None:
        """Without faults, each good frame is answered at once on UART and I2C."""
        self.board.faults.clear()
        self._listen(QUIET_S)
        self._calm()
        node = NodeClient(self.board.serial(), self.interface, timeout_s=ANSWER_S, retries=0)
        bus = self.board.i2c()
        for client in (node, I2cClient(bus, self.interface, wait=bus.wait, retries=0)):
            version = client.telemetry("Identification")["InterfaceVersion"]
            assert version == self.interface.version
            client.telemetry(self._one_of(self.steady).name)
        self.lines["uart"] = self.board.serial()
        for heard in map(vars, self.ears):
            self._note(heard)
            for what in heard.values():
                what.clear()

    def _note(self, found: object) -> None:
        self.trace.update(repr(found).encode())

    def _calm(self) -> None:
        """Waits for the end of a stream or picture."""
        until_ps = self.kernel.now + LONGEST_STREAM_S * PS_PER_S
        while self.kernel.now < until_ps:
            if not self._listen(QUIET_S):
                return
        pytest.fail("the device does not stop talking")

    def _listen(self, seconds: float) -> bool:
        self.kernel.advance_to(self.kernel.now + int(seconds * PS_PER_S))
        heard = False
        for line in self.lines.values():
            while data := line.read(READ_BYTES, 0.0):
                heard = True
                self.trace.update(data)
        return heard

    def _one_of(self, choices: Any) -> Any:
        return choices[self.rng.integers(len(choices))]

    def _noise(self) -> None:
        data = self.rng.bytes(int(self.rng.integers(1, 12)))
        if self.rng.random() < 0.3:
            data = data.replace(data[:1], b"\x1f")
        self.events += len(data)
        self.lines["uart"].write(data)

    def _frame(self, commands: bool) -> None:
        message = self._one_of(self.interface.messages)
        if bool(message.id & TELEMETRY_BIT) == commands:
            return
        length = message.length if commands else 0
        if self.rng.random() < 0.2:
            length = max(0, length + self._one_of([-1, 1]))
        self.events += 1
        self.lines["uart"].write(encode_frame(bytes([message.id]) + self.rng.bytes(length)))

    def _telemetry(self) -> None:
        self._frame(commands=False)

    def _command(self) -> None:
        self._frame(commands=True)

    def _bench(self) -> None:
        """Sends any byte; some of them take or send a picture."""
        if "bench_uart" in self.lines:
            self.events += 1
            self.lines["bench_uart"].write(self.rng.bytes(1))

    def _i2c(self) -> None:
        head = self._one_of(self.interface.messages).id | TELEMETRY_BIT
        self._transfer(bytes([head]) + self.rng.bytes(int(self.rng.integers(0, 3))))

    def _i2c_noise(self) -> None:
        self._transfer(self.rng.bytes(int(self.rng.integers(0, 12))))

    def _transfer(self, data: bytes) -> None:
        self.events += 1
        address = self._one_of(self.addresses)
        if self.rng.random() < 0.1:
            address = int(self.rng.integers(8, 0x78))
        messages = []
        if self.rng.random() < 0.8:
            messages.append(I2cMessage(address, bytearray(data)))
        if self.rng.random() < 0.6 or not messages:
            messages.append(I2cMessage(address, read=int(self.rng.integers(1, 30))))
        try:
            self.kernel.run(until=self.kernel.process(self.board.i2c_bus.transfer(messages)))
        except I2cError as error:
            self._note(error.errno)
        self._note([message.data for message in messages])

    def _disconnect(self) -> None:
        self.events += 1
        name = str(self.rng.choice(list(self.lines)))
        self.lines[name].close()
        self.kernel.advance_to(self.kernel.now + int(self.rng.integers(1, 10**9)))
        self.lines[name] = self.board.serial(name)

    def _inject(self) -> None:
        self.events += 1
        faults, kind = self.board.faults, self._one_of(self.kinds)
        options: dict[str, Any] = {"target": self._one_of(faults.targets(FAULTS[kind].site))}
        if "rate" in FAULTS[kind].declared():
            options["rate"] = UPSETS.get(kind, 0.2)
        if not FAULTS[kind].momentary:
            options["for_s"] = float(self.rng.exponential(0.05)) + 1e-6
        if self.rng.random() < 0.5:
            options["at_s"] = self.kernel.now / 1e12 + float(self.rng.exponential(0.02))
        faults.inject(kind, **options)

    def _clear(self) -> None:
        self.events += 1
        self.board.faults.clear()


SCENES = {
    "cubestar": replace(SkyScene.pointing(84, -1), mag_limit=3.8),
    "cubesense": EarthSunScene.facing(nadir_deg=(5, 5)),
    "aramis": SkyScene.pointing(84, -1),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", quick(SCENES, 1))
def test_fuzzed_board_recovers_and_repeats(name: str) -> None:
    runs = []
    for _ in range(2):
        with open_device(name, SCENES[name], seed=4) as opened:
            runs.append(Fuzzer(opened, seed=11).run(EVENTS))
    assert runs[0][0] > EVENTS // 100
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    ("turns", "events"),
    [
        ({"noise": 1.0}, 100_000),
        ({"telemetry": 0.5, "command": 0.5}, 300),
        pytest.param({"i2c_noise": 1.0}, 10_000, marks=pytest.mark.slow),
    ],
    ids=["bytes", "frames", "i2c"],
)
def test_reset_after_noise_gives_a_right_attitude(turns: dict[str, float], events: int) -> None:
    with open_device("cubestar", SCENES["cubestar"], seed=4) as opened:
        Fuzzer(opened, 11, turns).run(events)
        client, cubestar = opened.client.client, opened.client
        client.wait_processed(60)
        for name in ("StopLoop", "ClearConfig", "Reset"):
            client.command(name)
            client.wait_processed(10)  # a reset forgets what waits behind it
        assert cubestar.capture_and_process().name == "CALCULATED"
        cross, roll = errors(cubestar.attitude().quaternion, opened.board.truth())
    assert cross < 0.01
    assert abs(roll) < 0.05
