"""The satellite's side of the node: frames over UART and messages over I2C, in interrupt context.

Both carry the same telecommands and telemetry. A telecommand is checked here against the table
(ID, length, parameter ranges), acknowledged, and queued for the main loop; telemetry is answered
at once. Node dialect: a telemetry answer does not repeat the ID; a telecommand is acknowledged on
the UART with one error byte, on I2C through telemetry TcmdProcessed. Parameters behind the ID of
a telemetry request are ignored. An answer that the UART's buffer has no room for is dropped: a
host that waits for each answer never fills it.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Kind, Message
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import AckError
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Hardware

__all__ = ["LONGEST_COMMAND", "QUEUE_DEPTH", "SEND_BUFFER_BYTES", "Command", "HostLink"]

QUEUE_DEPTH = 4
LONGEST_COMMAND = 1 + max(message.length for message in INTERFACE.telecommands)
"""Bytes of the longest telecommand, its ID included."""

SEND_BUFFER_BYTES = 2048
"""What the UART may still have to send: ours, a third of a second at the default baud rate."""

NO_DATA = 0xFF
"""What a read delivers beyond the end of a message, or without one."""


@dataclass(frozen=True)
class Command:
    """An accepted telecommand with its decoded parameters."""

    message: Message
    values: dict[str, Any]


@dataclass(frozen=True)
class _Bus:
    """Names of the error flags that telecommands on one bus raise."""

    too_few: str
    too_many: str
    overflow: str


_UART = _Bus("UART_Tcmd_TooFewParm", "UART_Tcmd_TooManyParm", "UART_TcmdBufOfError")
_I2C = _Bus("I2C_TCMD_TooFewParm", "I2C_TCMD_TooManyparm", "I2C_TcmdBufOFError")


class HostLink:
    """Decodes what the host sends and answers it.

    Attributes:
        queue: accepted telecommands for the main loop.
    """

    def __init__(
        self,
        hardware: Hardware,
        meter: Meter,
        state: State,
        telemetry: Callable[[Message], dict[str, Any] | None],
    ) -> None:
        """Serve; ``telemetry`` gives a message's values, or None when it is not supported."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._telemetry = telemetry
        self.queue: deque[Command] = deque()
        self._decoder = FrameDecoder(LONGEST_COMMAND + 1)
        self._addressed = False
        self._written = bytearray()
        self._reading = False
        self._answer: bytes | None = None
        self._position = 0

    def next_command(self) -> Command:
        """Take the oldest accepted telecommand."""
        return self.queue.popleft()

    @property
    def idle(self) -> bool:
        """Whether nothing is under way that a reset would cut short: a message or an answer."""
        receiving = self._decoder.unfinished or self._addressed
        return not (receiving or self.queue or self._hardware.uart_backlog())

    # --- UART ---------------------------------------------------------------------------------

    def uart_byte(self, byte: int) -> None:
        """Interrupt: a byte came."""
        self._meter.charge(uart_interrupt=1)
        match self._decoder.feed(byte):
            case FrameEvent.FRAME | FrameEvent.TOO_LONG:  # the kept front is too long as well
                self._uart_message(self._decoder.payload)
            case FrameEvent.INCOMPLETE:
                self._state.raise_flag("UART_MsgIncomplete")
            case FrameEvent.PROTOCOL_ERROR:
                self._state.raise_flag("UART_ProtocolError")

    def _uart_message(self, payload: bytes) -> None:
        self._meter.charge(host_message=1)
        if not payload:
            self._state.raise_flag("UART_ProtocolError")
        elif payload[0] & TELEMETRY_BIT:
            answer = self._read_telemetry(payload[0])
            if answer is not None:
                self._uart_send(answer)
        else:
            self._uart_send(bytes([self._accept(payload[0], payload[1:], _UART)]))

    def _uart_send(self, payload: bytes) -> None:
        frame = encode_frame(payload)
        if self._hardware.uart_backlog() + len(frame) <= SEND_BUFFER_BYTES:
            self._hardware.uart_send(frame)

    def uart_silence(self) -> None:
        """Interrupt: nothing came for a while."""
        if self._decoder.reset():
            self._state.raise_flag("UART_MsgIncomplete")
            self._state.raise_flag("UART_RXTimeout")

    # --- I2C ----------------------------------------------------------------------------------

    def i2c_start(self, read: bool) -> None:
        """Interrupt: our address came, to write or to ``read``."""
        self._finish_write()
        self._addressed = True
        self._reading = read
        if read and self._answer is None:
            self._state.raise_flag("I2C_WaitForIDReadRequestError")

    def i2c_write(self, byte: int) -> bool:
        """Interrupt: a byte came; one beyond the longest telecommand is not acknowledged."""
        self._meter.charge(i2c_interrupt=1)
        if len(self._written) > LONGEST_COMMAND:
            return False
        self._written.append(byte)
        return True

    def i2c_read(self) -> int:
        """Interrupt: the next byte is wanted."""
        self._meter.charge(i2c_interrupt=1)
        answer = self._answer or b""
        byte = answer[self._position] if self._position < len(answer) else NO_DATA
        self._position += 1
        return byte

    def i2c_stop(self) -> None:
        """Interrupt: the transfer ended; a telemetry answer is used up once it was read."""
        self._finish_write()
        if self._reading:
            self._answer = None
        self._addressed = self._reading = False

    def _finish_write(self) -> None:
        """Act on the message that a stop or a repeated start ended."""
        if not self._written:
            return
        self._meter.charge(host_message=1)
        identifier, parameters = self._written[0], bytes(self._written[1:])
        self._written.clear()
        if identifier & TELEMETRY_BIT:
            self._answer = self._read_telemetry(identifier) or b""
            self._position = 0
        else:
            self._accept(identifier, parameters, _I2C)

    # --- both ---------------------------------------------------------------------------------

    def _read_telemetry(self, identifier: int) -> bytes | None:
        message = INTERFACE.find(identifier)
        values = None if message is None else self._telemetry(message)
        if message is None or values is None:
            self._state.raise_flag("TlmIDError")
            return None
        self._state.retained.telemetry += 1
        return message.pack(**values)

    def _accept(self, identifier: int, parameters: bytes, bus: _Bus) -> AckError:
        message = INTERFACE.find(identifier)
        if message is None or message.kind is not Kind.TELECOMMAND:
            self._state.raise_flag("TcmdIDError")
            return AckError.INVALID_ID
        if len(parameters) != message.length:
            short = len(parameters) < message.length
            self._state.raise_flag(bus.too_few if short else bus.too_many)
            return AckError.WRONG_LENGTH
        values = message.unpack(parameters)
        violations = message.violations(values)
        for _, flag in violations:
            if flag:
                self._state.raise_flag(flag)
        if violations:
            return AckError.BAD_PARAMETER
        if len(self.queue) >= QUEUE_DEPTH:
            self._state.raise_flag(bus.overflow)
            return AckError.BUFFER_FULL
        self.queue.append(Command(message, values))
        self._state.retained.telecommands += 1
        self._hardware.wake()
        return AckError.OK
