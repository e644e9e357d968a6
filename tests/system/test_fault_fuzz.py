"""Random bytes, messages, disconnects and faults, all mixed: no crash, no hang, no lost good frame.

CUBESTACK_FUZZ_EVENTS=1000000 makes as many events; the trace of a second run is the same to the
byte.
"""

import hashlib
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.i2c import I2cMessage, I2cNackError
from cubestack.emulator.sky.earth_sun import EarthSunScene
from cubestack.emulator.sky.scene import SkyScene
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.frames import encode_frame
from cubestack.firmware_model.interface.message import TELEMETRY_BIT
from cubestack.host.cli.session import open_cubesense, open_session
from cubestack.host.node_client import NodeClient

EVENTS = int(os.environ.get("CUBESTACK_FUZZ_EVENTS", "6000"))
CHECK_EVERY = 500
QUIET_S = 0.2

#: Share of each kind of turn; one byte, one message, one disconnect or one fault is one event.
TURNS = {
    "noise": 0.25,
    "telemetry": 0.35,
    "command": 0.02,
    "i2c": 0.25,
    "disconnect": 0.06,
    "inject": 0.05,
    "clear": 0.02,
}
UPSETS = {"memory-upsets": 1e-7, "register-upsets": 0.05}


class Fuzzer:
    """Mistreats one board.

    Attributes:
        events: how many there were.
        trace: of all that came back, with its time.
    """

    def __init__(self, session: Any, interface: Any, seed: int) -> None:
        self.board, self.interface = session.board, interface
        self.rng = np.random.default_rng(seed)
        self.line = self.board.serial()
        self.bus = self.board.i2c_bus
        self.trace = hashlib.sha256()
        self.events = 0
        self.board.faults.seed = seed
        self.kinds = [
            kind for kind, fault in FAULTS.items() if self.board.faults.targets(fault.site)
        ]
        self.turns = [getattr(self, f"_{name}") for name in TURNS]
        self.shares = list(TURNS.values())

    def run(self, events: int) -> tuple[int, str]:
        """Make ``events``; how many faults did something, and the trace."""
        due = CHECK_EVERY
        while self.events < events:
            self.turns[self.rng.choice(len(self.turns), p=self.shares)]()
            self._listen(float(self.rng.exponential(0.002)))
            if self.events >= due:
                due = self.events + CHECK_EVERY
                self.check()
        return self.board.faults.events, self.trace.hexdigest()

    def check(self) -> None:
        """Without faults, a good frame is answered."""
        self.board.faults.clear()
        self._listen(QUIET_S)
        self._calm()
        client = NodeClient(self.board.serial(), self.interface, timeout_s=0.5)
        values = client.telemetry("Identification")
        assert values["InterfaceVersion"] == self.interface.version
        assert self.board.uart.disturbance is None or not self.board.faults._running
        self.line = self.board.serial()

    def _calm(self) -> None:
        """A stream or a picture may be on its way: wait for its end, at most 200 s."""
        for _ in range(1000):
            if not self._listen(QUIET_S):
                return
        pytest.fail("the device does not stop talking")

    def _listen(self, seconds: float) -> bool:
        """Let time pass; whether the device said something."""
        until = self.board.kernel.now + int(seconds * 1e12)
        heard = False
        while self.board.kernel.now < until:
            left_s = (until - self.board.kernel.now) / 1e12
            data = self.line.read(4096, left_s)
            if data:
                heard = True
                self.trace.update(b"%d " % self.board.kernel.now + data)
            elif left_s < 1e-9:
                break
        return heard

    def _pick(self) -> Any:
        return self.interface.messages[self.rng.integers(len(self.interface.messages))]

    def _noise(self) -> None:
        data = self.rng.bytes(int(self.rng.integers(1, 12)))
        if self.rng.random() < 0.3:
            data = data.replace(data[:1], b"\x1f")
        self.events += len(data)
        self.line.write(data)

    def _frame(self, commands: bool) -> None:
        message = self._pick()
        if bool(message.id & TELEMETRY_BIT) == commands:
            return
        length = message.length if commands else 0
        if self.rng.random() < 0.1:
            length += 1
        self.events += 1
        self.line.write(encode_frame(bytes([message.id]) + self.rng.bytes(length)))

    def _telemetry(self) -> None:
        self._frame(commands=False)

    def _command(self) -> None:
        self._frame(commands=True)

    def _i2c(self) -> None:
        self.events += 1
        address = self.interface.i2c_address
        if self.rng.random() < 0.1:
            address = int(self.rng.integers(8, 0x78))
        messages = []
        if self.rng.random() < 0.8:
            head = bytes([self._pick().id | TELEMETRY_BIT])
            data = head + self.rng.bytes(int(self.rng.integers(0, 3)))
            messages.append(I2cMessage(address, bytearray(data)))
        if self.rng.random() < 0.6 or not messages:
            messages.append(I2cMessage(address, read=int(self.rng.integers(1, 30))))
        kernel = self.board.kernel
        try:
            kernel.run(until=kernel.process(self.bus.transfer(messages)))
        except I2cNackError as error:
            self.trace.update(b"%d" % (error.errno or 0))
        for message in messages:
            self.trace.update(bytes(message.data))

    def _disconnect(self) -> None:
        self.events += 1
        self.line.close()
        self.board.kernel.advance_to(self.board.kernel.now + int(self.rng.integers(1, 10**9)))
        self.line = self.board.serial()

    def _inject(self) -> None:
        self.events += 1
        faults = self.board.faults
        kind = self.kinds[self.rng.integers(len(self.kinds))]
        targets = faults.targets(FAULTS[kind].site)
        options: dict[str, Any] = {"target": targets[self.rng.integers(len(targets))]}
        if "rate" in FAULTS[kind].parameters():
            options["rate"] = UPSETS.get(kind, 0.2)
        if not FAULTS[kind].momentary:
            options["for_s"] = float(self.rng.exponential(0.05)) + 1e-6
        if self.rng.random() < 0.5:
            options["at_s"] = self.board.kernel.now / 1e12 + float(self.rng.exponential(0.02))
        faults.inject(kind, **options)

    def _clear(self) -> None:
        self.events += 1
        self.board.faults.clear()


def cubestar() -> Any:
    return open_session(SkyScene.pointing(84, -1), seed=4)


def cubesense() -> Any:
    return open_cubesense(EarthSunScene.facing(nadir_deg=(5, 5)), seed=4)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("open_board", "interface"), [(cubestar, CUBESTAR), (cubesense, CUBESENSE)]
)
def test_nothing_upsets_a_board_for_good(open_board: Callable[[], Any], interface: Any) -> None:
    runs = []
    for _ in range(2):
        with open_board() as session:
            fuzzer = Fuzzer(session, interface, seed=11)
            runs.append(fuzzer.run(EVENTS))
            fuzzer.check()
    assert runs[0][0] > EVENTS // 100
    assert runs[0] == runs[1]
