"""CubeSense's whole program on fake hardware.

Cameras, FPGAs, memories and supplies are as simple as the program can tell them apart; what the
FPGAs do follows from the levels of their pins alone, by the command table.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.ov7620.sccb import SccbSlave
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.links.node import NodeLink
from cubestack.firmware_model.cubesense.program import CubeSenseProgram
from cubestack.firmware_model.interface.cameras.ov7620 import REGISTERS
from cubestack.firmware_model.interface.cubesense import INTERFACE, pins
from cubestack.firmware_model.interface.cubesense.codes import (
    COLUMNS,
    ROWS,
    Camera,
    CaptureResult,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.fpga import Action, actions
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20
from cubestack.firmware_model.mcu.requests import AwaitPin, Request, Routine, StrobeRead

from ..host_side import HostSide, write_bytes
from ..runner import Runner
from .scenery import scan, window

CYCLE_NS = 200
FRAME_US = 33_367
READ_OUT_US = 30_507
LATCH_UP_MA = 120.0
LOST = 0xA5  # what a memory holds after its supply was off

ACK = {"SUNACK": Sram.SRAM1, "NADACK": Sram.SRAM2}
EDGE_ACTIONS = {Action.EDGE, Action.PASS_EDGE}
ADDRESSING = {Action.TAKE_ADDRESS, Action.READ_FROM}
LINES = ("SHIFT", "EDGE", "RNW")


def stored(camera: Camera, sram: Sram) -> CaptureResult:
    """The capture result of a picture that went to a memory."""
    own = sram.value == camera.value
    return CaptureResult.STORED_OWN_SRAM if own else CaptureResult.STORED_OTHER_SRAM


CAMERA_LINES = {
    line: camera for lines in (pins.CAMERA_SCL, pins.CAMERA_SDA) for camera, line in lines.items()
}


class SccbCamera:
    """A camera's registers behind its two lines."""

    def __init__(self) -> None:
        self.writes: list[tuple[int, int]] = []  #: (address, value) of every register written
        self.answers = True  #: whether it acknowledges
        self.power_up()

    def power_up(self) -> None:
        self.registers: dict[str, int] = {}  #: values by name, as far as written since power-up
        self._slave = SccbSlave(REGISTERS.i2c_address, self._write)

    def set(self, line: str, level: int, now_ns: int) -> None:
        self._slave.on_pin(line, level, 1000 * now_ns)

    def _write(self, address: int, value: int, _now_ps: int) -> None:
        if self.answers:
            self.writes.append((address, value))
            register = REGISTERS.at(address)
            assert register is not None
            self.registers[register.name] = value

    @property
    def sda(self) -> int:
        """0 while the camera pulls the line low."""
        return self._slave.sda if self.answers else 1


class Harness(Runner, HostSide):
    """A program on fake hardware."""

    interface = INTERFACE
    boot_us = 5_000
    hang_us = 200_000_000  # no job takes longer: a whole picture on the bench UART takes 27 s

    def __init__(
        self, switches: CubeSenseSwitches = DEFAULT_SWITCHES, *, mcu_addressing: bool = False
    ) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, PIC18F45K20)
        #: switches: of the program; the FPGAs are not those as printed
        self.switches = replace(switches, gateware="corrected")
        self.mcu_addressing = mcu_addressing
        self.serial_number = "CS0042"
        dark = np.full((ROWS, COLUMNS), 34, np.uint8)
        #: scenes: what each camera sends, (480, 640); None: it is dead
        self.scenes: dict[Camera, NDArray[np.uint8] | None] = dict.fromkeys(Camera, dark)
        self.wait_us = 17_500  #: from the store command to a picture's first row
        self.supply_ma = {pins.Monitor.SUPPLY_3V3: 31.4, pins.Monitor.SUPPLY_5V: 12.0}
        self.memory_ma = 5.0
        self.power_on()

    def power_on(self) -> None:
        #: what each memory holds
        self.memories = {sram: np.full((ROWS, COLUMNS), LOST, np.uint8) for sram in Sram}
        #: memories that draw ``LATCH_UP_MA`` until their supply is off
        self.latched: set[Sram] = set()
        self.cameras = {camera: SccbCamera() for camera in Camera}  #: control bus of each camera
        self.sent.clear()
        #: bench_sent, bench_backlog: as ``sent`` and ``backlog``, of the bench protocol's port
        self.bench_sent = bytearray()
        self.now_ns = self.backlog = self.bench_backlog = 0
        self.pins: dict[str, int] = {}  #: output pins
        self._boot()
        self.run()

    def start(self) -> Routine[None]:
        outputs = (*LINES, "CLK", "DATA_I", *pins.CAMERA_SCL.values(), *pins.CAMERA_SDA.values())
        self.pins = {**dict.fromkeys(outputs, 0), **dict.fromkeys(pins.ENABLE, 1)}
        self._doing = actions(0, 0, 0, 1, 1)
        self._coming: dict[Sram, tuple[int, NDArray[np.uint8]]] = {}
        self._position = 0
        for pin in (*pins.CAMERA_POWER.values(), *pins.SRAM_POWER.values()):
            self.set_pin(pin, 0)
        self.program = CubeSenseProgram(self, self.meter, switches=self.switches)
        return self.program.main()

    @property
    def link(self) -> NodeLink:
        return self.program.node

    @property
    def waiting(self) -> bool:
        return self.program.idle

    # --- what the program uses ------------------------------------------------------------------

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        if port is Port.NODE:
            super().uart_send(data)
        else:
            self.bench_sent += data

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        return self.backlog if port is Port.NODE else self.bench_backlog

    def adc_counts(self, monitor: pins.Monitor) -> int:
        memory = {pins.Monitor.SRAM1: Sram.SRAM1, pins.Monitor.SRAM2: Sram.SRAM2}
        if monitor not in memory:
            return round(self.supply_ma[monitor] / pins.MA_PER_COUNT)
        sram = memory[monitor]
        drawn = LATCH_UP_MA if sram in self.latched else self.memory_ma
        return round(drawn * self.pins[pins.SRAM_POWER[sram]] / pins.MA_PER_COUNT)

    # --- what a test uses -----------------------------------------------------------------------

    def letters(self, data: bytes) -> None:
        for byte in data:
            self.program.bench.uart_byte(byte)

    def write_register(self, *data: int) -> int:
        """A write transfer to the pointer's address; how many bytes were acknowledged."""
        count = write_bytes(self.program.registers, bytes(data))
        self.program.registers.i2c_stop()
        return count

    def read_register(self, count: int, pointer: int | None = None) -> bytes:
        """A read transfer from the pointer's address; 0 for a byte that is not there yet."""
        registers = self.program.registers
        if pointer is not None:
            assert write_bytes(registers, bytes([pointer])) == 1
        registers.i2c_start(True)
        data = bytes(registers.i2c_read() or 0 for _ in range(count))
        registers.i2c_stop()
        return data

    def latch_on(self, wanted: Request | type, sram: Sram) -> None:
        def latch(request: Request) -> None:
            if wanted in (request, type(request)):
                self.latched.add(sram)

        self.on_request = latch

    def cut(self) -> set[Sram]:
        return {sram for sram in Sram if not self.pins[pins.SRAM_POWER[sram]]}

    # --- pins -----------------------------------------------------------------------------------

    def get_pin(self, pin: str) -> int:
        return {name: self.cameras[c].sda for c, name in pins.CAMERA_SDA.items()}[pin]

    def set_pin(self, pin: str, level: int) -> None:
        was, self.pins[pin] = self.pins.get(pin), level
        if (of := CAMERA_LINES.get(pin)) is not None:  # nearly all calls
            if self.pins.get(pins.CAMERA_POWER[of]):
                self.cameras[of].set(pin[-3:], level, self.now_ns)
            return
        for camera in Camera:
            if pin == pins.CAMERA_POWER[camera] and was != level:
                self.cameras[camera].power_up()
        for sram in Sram:
            if pin == pins.SRAM_POWER[sram] and not level:
                self.memories[sram] = np.full((ROWS, COLUMNS), LOST, np.uint8)
                self.latched.discard(sram)
        if was == level or pin not in (*LINES, *pins.ENABLE, "CLK"):
            return
        if pin == "CLK":
            if level:
                assert Action.TAKE_ADDRESS in self._doing
                self._position = (self._position << 8 | self.pins["DATA_I"]) & 0xFFFFFF
            return
        enabled = not all(self.pins.get(name, 1) for name in pins.ENABLE)
        if pin in LINES and enabled:
            addressing = pin == "SHIFT" and ADDRESSING & {*self._doing}
            assert addressing, f"{pin} set while an FPGA is enabled"
        levels = [self.pins.get(name, 0) for name in (*LINES, *pins.ENABLE)]
        self._enter(actions(*levels, mcu_addressing=self.mcu_addressing))

    def _enter(self, doing: Any) -> None:
        moved = ADDRESSING & {*doing} and ADDRESSING & {*self._doing}
        self._doing = doing
        self._position = self._position if moved else 0
        self._coming = {}
        for half, action in zip(Sram, doing, strict=True):
            picture = self.scenes[Camera(1 - half if action is Action.STORE_OTHER else half)]
            if action in (Action.STORE, Action.STORE_OTHER) and picture is not None:
                ack_ns = self.now_ns + 1000 * (self.wait_us + READ_OUT_US)
                self._coming[half] = ack_ns, picture

    def await_pin(self, request: AwaitPin) -> bool:
        half = ACK[request.pin]
        deadline_ns = self.now_ns + 1000 * request.timeout_us
        ack_ns, picture = self._coming.get(half, (deadline_ns + 1, None))
        if ack_ns > deadline_ns:
            self.now_ns = deadline_ns
            return False
        poll_ns = request.poll_cycles * CYCLE_NS
        polls = max(1, -(-(ack_ns - self.now_ns) // poll_ns))
        self.now_ns += polls * poll_ns
        if self.pins[pins.SRAM_POWER[half]]:
            self.memories[half] = picture.copy()
        return True

    def strobe(self, request: StrobeRead) -> None:
        (half,) = [h for h in Sram if self._doing[h] in (Action.READ, *EDGE_ACTIONS, *ADDRESSING)]
        action, count = self._doing[half], len(request.target)
        owner = Sram(1 - half) if action is Action.PASS_EDGE else half
        assert action is not Action.TAKE_ADDRESS
        picture = self.memories[owner]
        if action in EDGE_ACTIONS:
            data = window(picture) if half == Camera.SUN else scan(picture)
        else:
            data = picture.reshape(-1)
        start = self._position
        if action is Action.READ_FROM:
            row, column = divmod(start, 1024)
            start = row * COLUMNS + column
        request.target[:] = np.take(data, range(start, start + count), mode="wrap")
        start += count
        if action is Action.READ_FROM:
            row, column = divmod(start % (ROWS * COLUMNS), COLUMNS)
            start = row << 10 | column
        self._position = start
        self.now_ns += count * request.cycles * CYCLE_NS
