"""The satellite's side of the star tracker: frames over UART, messages over I2C; interrupts.

Both carry the same telecommands and telemetry. A telecommand is checked here against the table,
acknowledged and queued for the main loop; telemetry is answered at once. Node dialect of the
CubeSpace family: a telemetry answer does not repeat the ID; a telecommand is acknowledged on the
UART with one error byte, and on both through telemetry TcmdProcessed. An unknown telemetry ID gets
no answer. Parameters behind the ID of a telemetry request are ignored. An answer that the UART's
buffer has no room for is dropped: a host that waits for each answer never fills it.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.aramis.hardware import AramisHardware
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES, INTERFACE, AckError
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Kind, Message
from cubestack.firmware_model.mcu.costs import Meter

__all__ = ["LONGEST_COMMAND", "QUEUE_DEPTH", "SEND_BUFFER_BYTES", "Command", "HostLink"]

QUEUE_DEPTH = 4
LONGEST_COMMAND = 1 + max(message.length for message in INTERFACE.telecommands)
"""Bytes of the longest telecommand, its ID included."""

SEND_BUFFER_BYTES = 8 * BLOCK_BYTES
"""What the UART may still have to send: ours."""

NO_DATA = 0xFF
"""What a read delivers beyond the end of a message, or without one."""

_VECTOR_LENGTH = (0.9, 1.1)
_ROTATION_LENGTH = (0.99, 1.01)


@dataclass(frozen=True)
class Command:
    """An accepted telecommand with its decoded parameters.

    Attributes:
        message: which one.
        values: its parameters.
        came_us: uptime when it came.
    """

    message: Message
    values: dict[str, Any]
    came_us: int


class HostLink:
    """Decodes what the host sends and answers it.

    Attributes:
        queue: accepted telecommands for the main loop.
        latest: ID and error code of the latest telecommand.
    """

    def __init__(
        self,
        hardware: AramisHardware,
        meter: Meter,
        state: State,
        telemetry: Callable[[Message], dict[str, Any]],
        urgent: Callable[[Command], None],
    ) -> None:
        """Serve.

        Args:
            hardware: the UART, and the main loop's sleep.
            meter: charged.
            state: flags and counters.
            telemetry: gives the values of a message.
            urgent: told of each accepted telecommand at once, before it is queued.
        """
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._telemetry = telemetry
        self._urgent = urgent
        self.queue: deque[Command] = deque()
        self._decoder = FrameDecoder(LONGEST_COMMAND + 1)
        self._written = bytearray()
        self._reading = False
        self._answer: bytes | None = None
        self._position = 0
        self.latest = (0, AckError.OK)

    # --- UART -------------------------------------------------------------------------------------

    def uart_byte(self, byte: int) -> None:
        """Interrupt: a byte came."""
        self._meter.charge(uart_interrupt=1)
        match self._decoder.feed(byte):
            case FrameEvent.FRAME | FrameEvent.TOO_LONG:  # the kept front is too long as well
                self._uart_message(self._decoder.payload)
            case FrameEvent.INCOMPLETE:
                self._state.raise_flag("UartIncomplete")
            case FrameEvent.PROTOCOL_ERROR:
                self._state.raise_flag("UartProtocolError")

    def _uart_message(self, payload: bytes) -> None:
        self._meter.charge(host_message=1)
        if not payload:
            self._state.raise_flag("UartProtocolError")
        elif payload[0] & TELEMETRY_BIT:
            answer = self._read_telemetry(payload[0])
            if answer is not None:
                self._uart_send(answer)
        else:
            self._uart_send(bytes([self._accept(payload[0], payload[1:])]))

    def _uart_send(self, payload: bytes) -> None:
        frame = encode_frame(payload)
        if self._hardware.uart_backlog() + len(frame) <= SEND_BUFFER_BYTES:
            self._hardware.uart_send(frame)

    def uart_silence(self) -> None:
        """Interrupt: nothing came for a while."""
        if self._decoder.reset():
            self._state.raise_flag("UartIncomplete")
            self._state.raise_flag("UartTimeout")

    # --- I2C --------------------------------------------------------------------------------------

    def i2c_start(self, read: bool) -> None:
        """Interrupt: our address came, to write or to ``read``."""
        self._finish_write()
        self._reading = read
        if read and self._answer is None:
            self._state.raise_flag("I2cReadWithoutId")

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
        self._reading = False

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
            self._accept(identifier, parameters)

    # --- both -------------------------------------------------------------------------------------

    def _read_telemetry(self, identifier: int) -> bytes | None:
        message = INTERFACE.find(identifier)
        if message is None:
            self._state.raise_flag("TlmIdError")
            return None
        self._state.telemetry += 1
        return message.pack(**self._telemetry(message))

    def _accept(self, identifier: int, parameters: bytes) -> AckError:
        error = self._judge(identifier, parameters)
        self.latest = identifier, error
        return error

    def _judge(self, identifier: int, parameters: bytes) -> AckError:
        """Queue a telecommand, or say what is wrong with it."""
        message = INTERFACE.find(identifier)
        if message is None or message.kind is not Kind.TELECOMMAND:
            self._state.raise_flag("TcmdIdError")
            return AckError.INVALID_ID
        if len(parameters) != message.length:
            self._state.raise_flag("TcmdLengthError")
            return AckError.WRONG_LENGTH
        values = message.unpack(parameters)
        flags = {flag or "ParameterError" for _, flag in message.violations(values)}
        flags |= _wrong_length(message.name, values)
        for flag in flags:
            self._state.raise_flag(flag)
        if flags:
            return AckError.BAD_PARAMETER
        if len(self.queue) >= QUEUE_DEPTH:
            self._state.raise_flag("TcmdBufferOverflow")
            return AckError.BUFFER_FULL
        command = Command(message, values, self._hardware.uptime_us())
        self._urgent(command)
        self.queue.append(command)
        self._state.telecommands += 1
        self._hardware.wake()
        return AckError.OK


def _wrong_length(command: str, values: dict[str, Any]) -> set[str]:
    """Flag of a direction or a rotation that is not of unit length."""
    bounds = {
        "GetAttitudeNearVector": (_VECTOR_LENGTH, "DirectionError"),
        "SetBodyRotation": (_ROTATION_LENGTH, "RotationError"),
    }
    if command not in bounds:
        return set()
    (low, high), flag = bounds[command]
    length = math.hypot(*(float(value) for value in values.values()))
    return set() if low <= length <= high else {flag}
