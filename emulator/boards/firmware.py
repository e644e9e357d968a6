"""A user's own firmware on a board: the wires of the machine's units, and its analysis.

The machine models the peripherals with their registers; this module connects its serial units and
I2C buses to the board's.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from cubestack.emulator.bus.line_format import FASTEST_BAUD, LineFormat, Parity
from cubestack.emulator.bus.uart import Uart, UartTap
from cubestack.emulator.camera.common.image_sensor import StarSensor
from cubestack.emulator.iss.insight.observer import History, Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import REGISTERS, Machine
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.serial import LEUART, USART

BY_PIN = 0x100
"""Unit numbers from here on identify a unit by its port pin; see the part's API."""

FRAMING_ERROR = 1
RATE_SHIFT = 8
"""Flags of a received character: its error, and the line's bits per second, 0 for any."""

CLOSE = 0.01
"""Largest relative difference between rates that count as equal."""

FLOATING = 0xFF
"""Byte that a master reads from I2C lines that nobody pulls low."""

ASKING = OutgoingKind.I2C_START, OutgoingKind.I2C_WRITE, OutgoingKind.I2C_READ
"""Messages of an I2C master that wait for an answer."""

I2C_MASTER = *ASKING, OutgoingKind.I2C_STOP

PARITIES: tuple[Parity, ...] = ("N", "N", "E", "O")
STOPS = (1.0, 1.0, 1.5, 2.0)
"""By the field of USART_FRAME; half a stop bit counts as one."""

FRAMES = [
    (instance.base + offset, layout)
    for layout, offset in ((USART, 0x004), (LEUART, 0x000))
    for instance in layout.instances
]
"""Address of each unit's frame register: USART_FRAME, LEUART_CTRL."""


@dataclass(eq=False)
class SerialWire(UartTap):
    """The device's end of a serial line, at port pins ``tx`` and ``rx`` (16 * port + bit).

    With ``follows`` the host's end takes the firmware's format, unless the host has set its own.
    """

    processor: FirmwareProcessor
    tx: int
    rx: int
    follows: bool = False

    def connect(self, uart: Uart) -> None:
        self._uart = uart
        self._nominal = uart.form
        uart.taps.append(self)

    def uart_byte(self, byte: int) -> None:
        self._receive(byte, 0)

    def uart_silence(self) -> None:
        """Ignored: silence does not change a pin."""

    def framing_error(self, time_ps: int) -> None:
        """Receive a character with a wrong stop bit; its data bits are unknown."""
        self._receive(0, FRAMING_ERROR)

    def sent(self, one: Outgoing) -> None:
        """Send the character that the machine's transmitter begins, at the host's rate if close."""
        if one.unit >> 8 != self.tx:
            return
        form = self._frame(one.unit & 0xFF)
        rate = round(form.bits * PS_PER_S / max(1, one.extra))
        form = replace(form, baud=min(max(1, rate), FASTEST_BAUD))
        uart = self._uart
        for known in (uart.host_form, self._nominal):
            if abs(rate - known.baud) < CLOSE * known.baud:
                form = replace(form, baud=known.baud)
                break
        if form != uart.form:
            if self._unset:
                uart.host_form = form
                ahead_ps = self.processor.look_ahead_ps
                self.processor.look_ahead_ps = min(ahead_ps, form.character_ps * 9 // 10)
            uart.form, uart.byte_ps = form, form.character_ps
        uart.send(bytes([one.value & 0xFF]))

    @property
    def _unset(self) -> bool:
        """Whether the host's end has the firmware's format, whatever that is."""
        return self.follows and self._uart.host_form == self._uart.form

    def _frame(self, unit: int) -> LineFormat:
        """Format of a unit's characters from its registers, with a dummy rate."""
        address, layout = FRAMES[unit]
        word = int.from_bytes(self.processor.machine.peek(address, 4), "little")
        if layout is LEUART:  # a ninth data bit does not exist on a serial line
            parity, stops = word >> 2 & 3, 2 if word >> 4 & 1 else 1
            return LineFormat(1, 8, PARITIES[parity], stops)
        data = min(max((word & 15) + 3, 5), 8)
        return LineFormat(1, data, PARITIES[word >> 8 & 3], STOPS[word >> 12 & 3])

    def _receive(self, byte: int, flags: int) -> None:
        machine, unit = self.processor.machine, BY_PIN | self.rx
        rate = 0 if self._unset else self._uart.form.baud << RATE_SHIFT  # 0: not checked
        self.processor.change_inputs(lambda: machine.uart_receive(unit, byte, flags | rate))


@dataclass(frozen=True)
class Core:
    """Registers of the processor's core, as a target of upsets."""

    processor: FirmwareProcessor

    @property
    def registers(self) -> Mapping[str, int]:
        """Width of each register with state."""
        special = {"xpsr": 32, "primask": 1, "basepri": 8, "faultmask": 1, "control": 2}
        return {name: special.get(name, 32) for name in REGISTERS if name != "sp"}

    def flip(self, register: str, bit: int) -> None:
        machine = self.processor.machine
        value = machine.register(register) ^ 1 << bit
        self.processor.change_inputs(lambda: machine.set_register(register, value))


@dataclass(eq=False)
class SlaveWire:
    """The machine's I2C slave at port pin ``sda`` (data line), which matches addresses itself."""

    processor: FirmwareProcessor
    sda: int
    _pending: bool = field(default=False, init=False)

    def i2c_address(self, address: int, read: bool) -> bool | None:
        """Handle a start; None until the firmware has decided."""
        answer = self._ask(lambda machine: machine.i2c_slave_start(self._unit, address << 1 | read))
        return None if answer is None else bool(answer)

    def i2c_start(self, read: bool) -> None:
        """Not called: see ``i2c_address``."""

    def i2c_write(self, byte: int) -> bool | None:
        answer = self._ask(lambda machine: machine.i2c_slave_write(self._unit, byte))
        return None if answer is None else bool(answer)

    def i2c_read(self) -> int | None:
        return self._ask(lambda machine: machine.i2c_slave_read(self._unit))

    def i2c_stop(self) -> None:
        """End the transfer, and a pending question."""
        self._pending = False
        machine = self.processor.machine
        self.processor.change_inputs(lambda: machine.i2c_slave_stop(self._unit))

    @property
    def _unit(self) -> int:
        return BY_PIN | self.sda

    def _ask(self, first: Callable[[Machine], int | None]) -> int | None:
        """The machine's answer; while it is None, further calls concern the same byte."""
        machine = self.processor.machine
        self.processor.catch_up()
        answer = machine.i2c_slave_poll(self._unit) if self._pending else first(machine)
        self._pending = answer is None
        self.processor.wake()
        return answer


@dataclass(eq=False)
class CameraWire:
    """A camera's control bus with the machine as master, whose data line is port pin ``sda``."""

    camera: StarSensor
    sda: int
    _address: int = field(default=0, init=False)
    _written: bytearray | None = field(default=None, init=False)
    _read: bytes = field(default=b"", init=False)

    def handle(self, machine: Machine, one: Outgoing) -> None:
        """Handle an output ``Kind.I2C_*`` of the machine; nobody answers on any other pins."""
        unit = one.unit & 0xFF
        if one.unit >> 8 != self.sda:
            if one.kind in ASKING:
                machine.i2c_answer(unit, False, FLOATING)
            return
        match one.kind:
            case OutgoingKind.I2C_START:
                self._finish(one.time_ps)
                machine.i2c_answer(unit, self._start(one.value, one.time_ps))
            case OutgoingKind.I2C_WRITE:
                if self._written is not None:
                    self._written.append(one.value & 0xFF)
                machine.i2c_answer(unit, self._written is not None)
            case OutgoingKind.I2C_READ:
                machine.i2c_answer(unit, True, self._next(one.time_ps))
            case OutgoingKind.I2C_STOP:
                self._finish(one.time_ps)

    def _start(self, address_byte: int, now_ps: int) -> bool:
        self._address, reads = address_byte >> 1, bool(address_byte & 1)
        if reads:
            self._read = b""
            return self.camera.i2c_read(self._address, 0, now_ps) is not None
        answers = self.camera.i2c_write(self._address, b"", now_ps)
        self._written = bytearray() if answers else None
        return answers

    def _next(self, now_ps: int) -> int:
        """The camera's next byte; ``FLOATING`` if it does not answer."""
        if not self._read:
            self._read = self.camera.i2c_read(self._address, self.camera.word_bytes, now_ps) or b""
        byte, self._read = (self._read[0], self._read[1:]) if self._read else (FLOATING, b"")
        return byte

    def _finish(self, now_ps: int) -> None:
        if self._written is not None:
            self.camera.i2c_write(self._address, bytes(self._written), now_ps)
            self._written = None


class Insight:
    """Profile, coverage and history of a loaded machine.

    It is observed from the first use on; until then it runs at full speed.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self._observed = False

    @cached_property
    def symbols(self) -> Symbols:
        return Symbols.of(self.machine.image)

    @cached_property
    def observer(self) -> Observer:
        """Counts cycles, executions and calls."""
        self._observed = True
        return Observer(self.machine, self.symbols)

    @cached_property
    def history(self) -> History:
        """Records each function and exception; the caller must call ``take`` regularly."""
        interrupts = {
            number: name
            for layout in LAYOUTS
            for instance in layout.instances
            for name, number in instance.interrupts.items()
        }
        return History(self.observer, interrupts)

    def close(self) -> None:
        if self._observed:
            self.observer.close()
