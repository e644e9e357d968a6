"""What leads from a machine's serial units and I2C buses to a board's, for a user's own firmware.

The peripherals are in the machine, down to their registers; here are the wires.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from cubestack.emulator.bus.line_format import FASTEST_BAUD, LineFormat, Parity
from cubestack.emulator.bus.uart import Uart, UartTap
from cubestack.emulator.camera.common.star_sensor import StarSensor
from cubestack.emulator.iss.machine import REGISTERS, Machine
from cubestack.emulator.iss.outcome import Kind, Outgoing
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.efm32gg.serial import LEUART, USART

BY_PIN = 0x100
"""Units at or above it name the port pin that leads to one; see the part's api."""

FRAMING_ERROR = 1
RATE_SHIFT = 8
"""Flags of a received character: what is wrong with it, and the line's bits a second."""

CLOSE = 0.01
"""Rates that differ by less are the same to both ends."""

PARITIES: tuple[Parity, ...] = ("N", "N", "E", "O")
STOPS = (1.0, 1.0, 1.5, 2.0)
"""By the field of USART_FRAME; half a stop bit is heard as a whole one."""

FRAMES = [
    (instance.base + offset, layout)
    for layout, offset in ((USART, 0x004), (LEUART, 0x000))
    for instance in layout.instances
]
"""Where each unit's frame is set: USART_FRAME, LEUART_CTRL."""


@dataclass(eq=False)
class SerialWire(UartTap):
    """A serial line's device end, at two port pins.

    Attributes:
        processor: whose firmware it is.
        tx, rx: port pins, port times 16 plus bit.
    """

    processor: FirmwareProcessor
    tx: int
    rx: int

    def connect(self, uart: Uart) -> None:
        """Be the end of ``uart``."""
        self._uart = uart
        self._nominal = uart.form
        uart.taps.append(self)

    def uart_byte(self, byte: int) -> None:
        """A character has arrived."""
        self._receive(byte, 0)

    def uart_silence(self) -> None:
        """Silence is nothing that a pin would tell of."""

    def framing_error(self, time_ps: int) -> None:
        """A character with a wrong stop bit has arrived; what its bits were is not known."""
        self._receive(0, FRAMING_ERROR)

    def sent(self, one: Outgoing) -> None:
        """The machine's transmitter begins a character; a rate close to the host's is the same."""
        if one.unit >> 8 != self.tx:
            return
        form = self._frame(one.unit & 0xFF)
        rate = round(form.bits * PS_PER_S / max(1, one.extra))
        form = replace(form, baud=min(max(1, rate), FASTEST_BAUD))
        for known in (self._uart.host_form, self._nominal):
            if abs(rate - known.baud) < CLOSE * known.baud:
                form = replace(form, baud=known.baud)
                break
        self._take(form)
        self._uart.send(bytes([one.value & 0xFF]))

    def _frame(self, unit: int) -> LineFormat:
        """Bits of a unit's characters by its registers; at any rate."""
        address, where = FRAMES[unit]
        word = int.from_bytes(self.processor.machine.peek(address, 4), "little")
        if where is LEUART:  # a ninth data bit is not one of a serial line's
            parity, stops = word >> 2 & 3, 2 if word >> 4 & 1 else 1
            return LineFormat(1, 8, PARITIES[parity], stops)
        data = min(max((word & 15) + 3, 5), 8)
        return LineFormat(1, data, PARITIES[word >> 8 & 3], STOPS[word >> 12 & 3])

    def _take(self, form: LineFormat) -> None:
        if form != self._uart.form:
            self._uart.form, self._uart.byte_ps = form, form.character_ps

    def _receive(self, byte: int, flags: int) -> None:
        machine, unit = self.processor.machine, BY_PIN | self.rx
        rate = self._uart.form.baud << RATE_SHIFT
        self.processor.give(lambda: machine.uart_receive(unit, byte, flags | rate))


@dataclass(frozen=True)
class Core:
    """The core's registers, for upsets."""

    processor: FirmwareProcessor

    @property
    def registers(self) -> Mapping[str, int]:
        """Those that hold state, and how many bits they have."""
        special = {"xpsr": 32, "primask": 1, "basepri": 8, "faultmask": 1, "control": 2}
        return {name: special.get(name, 32) for name in REGISTERS if name != "sp"}

    def flip(self, register: str, bit: int) -> None:
        """Turn over a bit, now."""
        machine = self.processor.machine
        value = machine.register(register) ^ 1 << bit
        self.processor.give(lambda: machine.set_register(register, value))


@dataclass(eq=False)
class SlaveWire:
    """The machine's I2C slave as a target that knows its addresses by its own registers.

    Attributes:
        processor: whose firmware it is.
        sda: port pin of the data line.
    """

    processor: FirmwareProcessor
    sda: int
    _asked: bool = field(default=False, init=False)

    def i2c_address(self, address: int, read: bool) -> bool | None:
        """A start; None until the firmware has decided."""
        answer = self._ask(lambda machine: machine.i2c_slave_start(self._unit, address << 1 | read))
        return None if answer is None else bool(answer)

    def i2c_start(self, read: bool) -> None:
        """Not called: see ``i2c_address``."""

    def i2c_write(self, byte: int) -> bool | None:
        """A byte came."""
        answer = self._ask(lambda machine: machine.i2c_slave_write(self._unit, byte))
        return None if answer is None else bool(answer)

    def i2c_read(self) -> int | None:
        """The next byte."""
        return self._ask(lambda machine: machine.i2c_slave_read(self._unit))

    def i2c_stop(self) -> None:
        """The transfer ended; whoever stretched the clock is asked no longer."""
        self._asked = False
        machine = self.processor.machine
        self.processor.give(lambda: machine.i2c_slave_stop(self._unit))

    @property
    def _unit(self) -> int:
        return BY_PIN | self.sda

    def _ask(self, first: Callable[[Machine], int | None]) -> int | None:
        """The answer; the same question again is about the same byte."""
        machine = self.processor.machine
        self.processor.catch_up()
        answer = machine.i2c_slave_poll(self._unit) if self._asked else first(machine)
        self._asked = answer is None
        self.processor.wake()
        return answer


@dataclass(eq=False)
class CameraWire:
    """A camera's control bus, whose master the machine is.

    Attributes:
        camera: the only one on it.
        sda: port pin of the data line.
    """

    camera: StarSensor
    sda: int
    _address: int = field(default=0, init=False)
    _written: bytearray | None = field(default=None, init=False)
    _read: bytes = field(default=b"", init=False)

    def happened(self, machine: Machine, one: Outgoing) -> None:
        """The master does something; on ``Kind.I2C_*`` of its pins."""
        if one.unit >> 8 != self.sda:
            return
        unit = one.unit & 0xFF
        match one.kind:
            case Kind.I2C_START:
                self._finish(one.time_ps)
                machine.i2c_answer(unit, self._start(one.value, one.time_ps))
            case Kind.I2C_WRITE:
                if self._written is not None:
                    self._written.append(one.value & 0xFF)
                machine.i2c_answer(unit, self._written is not None)
            case Kind.I2C_READ:
                machine.i2c_answer(unit, True, self._next(one.time_ps))
            case Kind.I2C_STOP:
                self._finish(one.time_ps)

    def _start(self, address_byte: int, now_ps: int) -> bool:
        """Whether the camera answers to its address."""
        self._address, reads = address_byte >> 1, bool(address_byte & 1)
        if reads:
            self._read = b""
            return self.camera.i2c_read(self._address, 0, now_ps) is not None
        answers = self.camera.i2c_write(self._address, b"", now_ps)
        self._written = bytearray() if answers else None
        return answers

    def _next(self, now_ps: int) -> int:
        """The next byte of the camera; the pulled-up line where it is gone."""
        if not self._read:
            self._read = self.camera.i2c_read(self._address, self.camera.word_bytes, now_ps) or b""
        byte, self._read = (self._read[0], self._read[1:]) if self._read else (0xFF, b"")
        return byte

    def _finish(self, now_ps: int) -> None:
        """What was written takes effect at the end."""
        if self._written is not None:
            self.camera.i2c_write(self._address, bytes(self._written), now_ps)
            self._written = None
