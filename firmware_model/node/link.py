"""A node's link to the satellite: frames over UART and messages over I2C, in interrupt context.

Both buses have the same telecommands and telemetry. A telecommand is checked here against the table
(ID, length, parameter ranges), acknowledged, and queued for the main loop; telemetry is answered
at once. Dialect of the CubeSpace family of nodes: a telemetry answer does not repeat the ID; a
telecommand is acknowledged on the UART with one error byte, on I2C through telemetry TcmdProcessed.
An unknown telemetry ID gets no answer. Bytes after the ID of a telemetry request are ignored. An
answer is dropped if the UART's buffer has no room for it: a host that waits for each answer never
fills the buffer.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, ClassVar

from cubestack.firmware_model.interface.codec.frames import (
    END,
    FrameDecoder,
    FrameEvent,
    encode_frame,
)
from cubestack.firmware_model.interface.codec.message import (
    TELEMETRY_BIT,
    Interface,
    Message,
    MessageKind,
)
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.commands import BoundedQueue, QueuedCommand
from cubestack.firmware_model.node.hardware import NodeHardware
from cubestack.firmware_model.node.state import NodeState

NO_DATA = 0xFF  #: byte read beyond the end of a message, or without one


def longest_command(interface: Interface) -> int:
    """Length of the longest telecommand in bytes, its ID included."""
    return 1 + max(message.length for message in interface.telecommands)


@dataclass(frozen=True)
class BusFlags:
    """Names of the error flags for messages on one bus; None: no flag."""

    overflow: str  #: telecommand while the queue is full
    #: too_few, too_many: parameter bytes of a telecommand
    too_few: str | None = None
    too_many: str | None = None
    unknown_telemetry: str | None = None  #: telemetry ID that the node does not support


@dataclass(frozen=True)
class LinkFlags:
    """Names of a node's error flags for its link; None: no flag."""

    #: uart, i2c: flags that differ between the buses
    uart: BusFlags
    i2c: BusFlags
    protocol_error: str  #: byte outside of a frame, unknown escape or empty frame
    incomplete: str  #: frame that never ended
    #: I2C read without an answer; one rejected with a flag counts as an empty answer
    read_without_id: str
    timeout: str | None = None  #: silence inside a frame
    unknown_command: str | None = None  #: unknown telecommand ID
    bad_parameter: str | None = None  #: parameter out of a range whose table names no flag


@dataclass(eq=False)
class SatelliteLink(ABC):
    """Decodes the host's messages and answers them; a node implements their meaning."""

    hardware: NodeHardware
    meter: Meter
    state: NodeState  #: its error flags are raised
    interface: Interface
    flags: LinkFlags
    send_buffer_bytes: int  #: capacity of the UART's send buffer

    #: Byte on the UART before which no message is complete: others are only decoded and charged.
    frame_end: ClassVar[int] = END

    def __post_init__(self) -> None:
        self._longest = longest_command(self.interface)
        self._decoder = FrameDecoder(self._longest + 1)
        self._addressed = False
        self._written = bytearray()
        self._reading = False
        self._requested = 0
        self._answer: bytes | None = None
        self._position = 0

    # --- implemented by a node --------------------------------------------------------------------

    @abstractmethod
    def _values(self, message: Message) -> dict[str, Any] | None:
        """Values of telemetry ``message``, and count it; None if it is not supported."""

    @abstractmethod
    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        """Queue an accepted telecommand; False if the queue is full."""

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str | None]:
        """Error flags of bad parameters, None for one without a flag; empty if all are good."""
        return [flag or self.flags.bad_parameter for _, flag in message.violations(values)]

    @property
    def receiving(self) -> bool:
        """Whether a frame or a transfer has begun and not ended."""
        return self._decoder.unfinished or self._addressed

    # --- UART -------------------------------------------------------------------------------------

    def uart_block(self, data: bytes) -> None:
        """Interrupts for ``data``, of which only the last byte may end a frame."""
        if not self._decoder.takes(data):
            for byte in data:
                self.uart_byte(byte)
            return
        self.meter.charge(uart_interrupt=len(data), host_message=1)
        self._uart_message(self._decoder.payload)

    def uart_byte(self, byte: int) -> None:
        self.meter.charge(uart_interrupt=1)
        match self._decoder.feed(byte):
            case FrameEvent.FRAME | FrameEvent.TOO_LONG:  # the kept front is too long as well
                self.meter.charge(host_message=1)
                self._uart_message(self._decoder.payload)
            case FrameEvent.INCOMPLETE:
                self._raise(self.flags.incomplete)
            case FrameEvent.PROTOCOL_ERROR:
                self._raise(self.flags.protocol_error)

    def uart_silence(self) -> None:
        """Interrupt: nothing was received for a while."""
        if self._decoder.reset():
            self._raise(self.flags.incomplete)
            self._raise(self.flags.timeout)

    def _uart_message(self, payload: bytes) -> None:
        if not payload:
            self._raise(self.flags.protocol_error)
        elif payload[0] & TELEMETRY_BIT:
            self._uart_answer(payload[0])
        else:
            self._uart_send(bytes([self._accept(payload[0], payload[1:], self.flags.uart)]))

    def _uart_answer(self, identifier: int) -> bool:
        """Send a telemetry message; False if the host does not get it."""
        answer = self._read_telemetry(identifier, self.flags.uart)
        return answer is not None and self._uart_send(answer)

    def _uart_send(self, payload: bytes) -> bool:
        """Answer if the buffer has room; returns whether it had."""
        frame = encode_frame(payload)
        room = self.hardware.uart_backlog() + len(frame) <= self.send_buffer_bytes
        if room:
            self._transmit(frame)
        return room

    def _transmit(self, frame: bytes) -> None:
        self.hardware.uart_send(frame)

    # --- I2C --------------------------------------------------------------------------------------

    def i2c_start(self, read: bool) -> None:
        """Interrupt: the node is addressed, for a write or a ``read``."""
        self._finish_write()
        self._addressed = True
        self._reading = read
        if read and self._answer is None:
            self._raise(self.flags.read_without_id)

    def i2c_write(self, byte: int) -> bool:
        """Interrupt: a byte was received; returns False (NACK) beyond the longest telecommand."""
        self.meter.charge(i2c_interrupt=1)
        if len(self._written) > self._longest:
            return False
        self._written.append(byte)
        return True

    def i2c_read(self) -> int:
        """Interrupt: the master reads a byte; beyond the end of an answer it is 255."""
        self.meter.charge(i2c_interrupt=1)
        answer = self._answer or b""
        byte = answer[self._position] if self._position < len(answer) else NO_DATA
        self._position += 1
        return byte

    def i2c_stop(self) -> None:
        self._finish_write()
        if self._reading:
            self._finish_read()
        self._addressed = self._reading = False

    def _finish_read(self) -> None:
        """A telemetry answer can be read once."""
        self._answer = None

    def _finish_write(self) -> None:
        """Process the message that a stop or a repeated start ended."""
        if not self._written:
            return
        self.meter.charge(host_message=1)
        identifier, parameters = self._written[0], bytes(self._written[1:])
        self._written.clear()
        if identifier & TELEMETRY_BIT:
            self._requested = identifier
            self._answer = self._read_telemetry(identifier, self.flags.i2c)
            if self._answer is None and self.flags.i2c.unknown_telemetry:
                self._answer = b""
            self._position = 0
        else:
            self._accept(identifier, parameters, self.flags.i2c)

    # --- both buses -------------------------------------------------------------------------------

    def _raise(self, flag: str | None) -> None:
        if flag is not None:
            self.state.raise_flag(flag)

    def _read_telemetry(self, identifier: int, bus: BusFlags) -> bytes | None:
        message = self.interface.find(identifier)
        values = None if message is None else self._values(message)
        if message is None or values is None:
            self._raise(bus.unknown_telemetry)
            return None
        return message.pack(**values)

    def _accept(self, identifier: int, parameters: bytes, bus: BusFlags) -> AckError:
        """Queue a telecommand, or return its error."""
        message = self.interface.find(identifier)
        if message is None or message.kind is not MessageKind.TELECOMMAND:
            self._raise(self.flags.unknown_command)
            return AckError.INVALID_ID
        if len(parameters) != message.length:
            self._raise(bus.too_few if len(parameters) < message.length else bus.too_many)
            return AckError.WRONG_LENGTH
        values = dict(message.unpack(parameters))
        refusals = self._refusals(message, values)
        if refusals:
            for flag in refusals:
                self._raise(flag)
            return AckError.BAD_PARAMETER
        if not self._enqueue(message, values):
            self._raise(bus.overflow)
            return AckError.BUFFER_FULL
        self.hardware.wake()
        return AckError.OK


@dataclass(eq=False)
class QueueingLink(SatelliteLink):
    """Queues telecommands for the main loop and answers telemetry at once."""

    telemetry: Callable[[Message], dict[str, Any] | None]  #: a message's values; None: unsupported

    def __post_init__(self) -> None:
        super().__post_init__()
        self.queue: BoundedQueue[QueuedCommand] = BoundedQueue()  #: accepted telecommands
        self.latest = (0, AckError.OK)  #: ID and error code of the latest telecommand

    def processed(self, running: bool) -> dict[str, int]:
        """Values of telemetry TcmdProcessed; ``running``: a telecommand is being executed."""
        waiting = len(self.queue)
        latest, error = self.latest
        done = not waiting and not running
        return {"Processed": int(done), "Waiting": waiting, "Latest": latest, "Error": error}

    def _values(self, message: Message) -> dict[str, Any] | None:
        return self.telemetry(message)

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        return self.queue.put(QueuedCommand(message, values, self.hardware.uptime_us()))

    def _accept(self, identifier: int, parameters: bytes, bus: BusFlags) -> AckError:
        error = super()._accept(identifier, parameters, bus)
        self.latest = identifier, error
        return error
