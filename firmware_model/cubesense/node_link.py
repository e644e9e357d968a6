"""The node protocol's side of the satellite: frames over UART, messages over I2C; interrupts.

Both carry the same telecommands and telemetry. A telecommand is checked here, acknowledged and
queued for the main loop; telemetry is answered at once. Node dialect: a telemetry answer does not
repeat the ID; a telecommand is acknowledged on the UART with one error byte, on I2C through
telemetry TcmdProcessed.

Ours, where the public material is silent: an unknown telemetry ID gets no answer and raises
UartProtocolError on the UART, I2cTlmReadError (once it is read) on I2C. Parameters behind the ID
of a telemetry request are ignored. Counters count every message that came, refused ones too. A
result that schedules the next measurement does so once its answer is on its way (UART), or once the
transfer that read some of it has ended (I2C); when the queue is full nothing is scheduled, the
result stays, and TcmdBufferOverrun is raised. An answer that the UART has no room for is dropped:
a host that waits for each answer never fills it.
"""

from collections.abc import Mapping

from cubestack.firmware_model.cubesense.download import Download
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.cubesense.jobs import JobQueue, Measure, Telecommand
from cubestack.firmware_model.cubesense.state import State, distortion_of
from cubestack.firmware_model.cubesense.telemetry import Telemetry
from cubestack.firmware_model.cubesense.vision.lens_check import invertible
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Message, Value
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.codec.register_pointer import FILL
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    FRAME_BYTES,
    Camera,
    NadirSearch,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.telemetry import SCHEDULES
from cubestack.firmware_model.mcu.costs import Meter

__all__ = ["LONGEST_COMMAND", "SEND_BYTES", "NodeLink"]

LONGEST_COMMAND = 1 + max(message.length for message in INTERFACE.telecommands)
"""Bytes of the longest telecommand, its ID included."""

SEND_BYTES = len(encode_frame(b"")) + 2 * FRAME_BYTES
"""What the UART may still have to send: the longest answer, every byte of it doubled."""


class NodeLink:
    """Decodes what the host sends and answers it."""

    def __init__(
        self,
        hardware: CubeSenseHardware,
        meter: Meter,
        state: State,
        queue: JobQueue,
        telemetry: Telemetry,
        download: Download,
    ) -> None:
        """Fill ``queue``; ``telemetry`` gives values, ``download`` knows which frames exist."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._queue = queue
        self._telemetry = telemetry
        self._download = download
        self._decoder = FrameDecoder(LONGEST_COMMAND)
        self._latest: Telecommand | None = None
        self._written = bytearray()
        self._reading = False
        self._answer: tuple[int, bytes] | None = None
        self._position = 0

    # --- UART ---------------------------------------------------------------------------------

    def uart_byte(self, byte: int) -> None:
        """Interrupt: a byte came."""
        self._meter.charge(uart_interrupt=1)
        match self._decoder.feed(byte):
            case FrameEvent.FRAME:
                self._uart_message(self._decoder.payload)
            case FrameEvent.TOO_LONG:  # longer than any: the missing bytes do not matter
                self._uart_message(self._decoder.payload + b"\0")
            case FrameEvent.INCOMPLETE:
                self._state.flags.add("UartMsgIncomplete")
            case FrameEvent.PROTOCOL_ERROR:
                self._state.flags.add("UartProtocolError")

    def uart_silence(self) -> None:
        """Interrupt: nothing came for a while."""
        if self._decoder.reset():
            self._state.flags.add("UartMsgIncomplete")

    def _uart_message(self, payload: bytes) -> None:
        self._meter.charge(host_message=1)
        if not payload:
            self._state.flags.add("UartProtocolError")
        elif payload[0] & TELEMETRY_BIT:
            answer = self._read_telemetry(payload[0])
            if answer is None:
                self._state.flags.add("UartProtocolError")
            elif self._uart_send(answer):
                self._taken(payload[0])
        else:
            self._uart_send(bytes([self._accept(payload[0], payload[1:])]))

    def _uart_send(self, payload: bytes) -> bool:
        frame = encode_frame(payload)
        room = self._hardware.uart_backlog(Port.NODE) + len(frame) <= SEND_BYTES
        if room:
            self._meter.charge(uart_interrupt=len(frame))
            self._hardware.uart_send(Port.NODE, frame)
        return room

    # --- I2C ----------------------------------------------------------------------------------

    def i2c_start(self, read: bool) -> None:
        """Interrupt: our address came, to write or to ``read``."""
        self.i2c_stop()
        self._reading = read
        if read and self._answer is None:
            self._state.flags.add("I2cTlmReadError")

    def i2c_write(self, byte: int) -> bool:
        """Interrupt: a byte came; one beyond the longest telecommand is not acknowledged."""
        self._meter.charge(i2c_interrupt=1)
        if len(self._written) > LONGEST_COMMAND:
            return False
        self._written.append(byte)
        return True

    def i2c_read(self) -> int | None:
        """Interrupt: the next byte is wanted; beyond the end of an answer it is 255."""
        self._meter.charge(i2c_interrupt=1)
        data = b"" if self._answer is None else self._answer[1]
        byte = data[self._position] if self._position < len(data) else FILL
        self._position += 1
        return byte

    def i2c_stop(self) -> None:
        """Interrupt: the transfer ended; an answer is used up once some of it was read."""
        if self._written:
            self._i2c_message(bytes(self._written))
            self._written.clear()
        if self._reading and self._position and self._answer is not None:
            identifier, _ = self._answer
            self._answer = None
            self._taken(identifier)
        self._reading = False

    def _i2c_message(self, message: bytes) -> None:
        self._meter.charge(host_message=1)
        if message[0] & TELEMETRY_BIT:
            data = self._read_telemetry(message[0])
            self._answer = None if data is None else (message[0], data)
            self._position = 0
        else:
            self._accept(message[0], message[1:])

    # --- both ---------------------------------------------------------------------------------

    def _read_telemetry(self, identifier: int) -> bytes | None:
        self._state.telemetries += 1
        message = INTERFACE.find(identifier)
        return None if message is None else message.pack(**self._telemetry.values(message))

    def _taken(self, identifier: int) -> None:
        """The host has a telemetry frame."""
        if identifier not in SCHEDULES:
            return
        camera, sram = SCHEDULES[identifier]
        if self._queue.put(Measure(camera, sram, detect=True)):
            self._state.schedule(camera, sram, detect=True)
            self._hardware.wake()
        else:
            self._state.flags.add("TcmdBufferOverrun")

    def _accept(self, identifier: int, parameters: bytes) -> AckError:
        """Check a telecommand and queue it; what telemetry TcmdProcessed says follows."""
        self._state.telecommands += 1
        if self._latest is not None:
            self._latest.latest = False
        self._latest = None
        error = self._check_and_queue(identifier, parameters)
        self._state.last_command = identifier
        self._state.last_error = error
        self._state.last_processed = int(error is not AckError.OK)
        return error

    def _check_and_queue(self, identifier: int, parameters: bytes) -> AckError:
        message = INTERFACE.find(identifier)
        if message is None:
            return AckError.INVALID_ID
        if len(parameters) != message.length:
            return AckError.WRONG_LENGTH
        values = dict(message.unpack(parameters))
        if message.violations(values) or not self._possible(message, values):
            return AckError.BAD_PARAMETER
        if self._queue.full:
            self._state.flags.add("TcmdBufferOverrun")
            return AckError.BUFFER_FULL
        self._latest = Telecommand(message, values, latest=True)
        self._announce(self._latest)
        self._queue.put(self._latest)
        self._hardware.wake()
        return AckError.OK

    def _possible(self, message: Message, values: Mapping[str, Value]) -> bool:
        """What the table can not say of a telecommand's parameters."""
        match message.name:
            case "NextImageFrame":
                return self._download.has(int(values["Frame"]))
            case "Distortion1" | "Distortion2":
                return invertible(distortion_of(values), self._meter)
            case "SetNadirSearch":
                lines = values["Search"] == NadirSearch.LINES
                return lines or self._hardware.mcu_addressing
        return True

    def _announce(self, job: Telecommand) -> None:
        """What telemetry shows of a telecommand before it is executed."""
        values = job.values
        match job.message.name:
            case "CaptureAndDetect" | "CaptureOnly":
                detect = job.message.name == "CaptureAndDetect"
                self._state.schedule(Camera(values["Camera"]), Sram(values["Sram"]), detect=detect)
            case "StartImageDownload" | "NextImageFrame":
                job.frame = self._download.request(values)
