"""CubeSense's link with the node protocol, on UART and I2C; interrupt context.

Assumed, because the public material does not say: an unknown telemetry ID raises UartProtocolError
on the UART, I2cTlmReadError (once it is read) on I2C. Counters count every received message,
rejected ones too. A result that schedules the next measurement does so once its answer is queued
(UART), or once the transfer that read a part of it has ended (I2C); if the queue is full nothing is
scheduled, the result stays, and TcmdBufferOverrun is raised.
"""

from collections.abc import Collection
from typing import Any

from cubestack.firmware_model.cubesense.jobs import JobQueue, Measure, TelecommandJob
from cubestack.firmware_model.cubesense.state import State, distortion_of
from cubestack.firmware_model.cubesense.telemetry import Telemetry
from cubestack.firmware_model.cubesense.vision.lens_check import invertible
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes
from cubestack.firmware_model.interface.cubesense.telemetry import SCHEDULES
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, SatelliteLink

#: Capacity of the UART's send buffer: the longest answer, every byte of it doubled.
SEND_BYTES = len(encode_frame(b"")) + 2 * codes.FRAME_BYTES

_FLAGS = LinkFlags(
    uart=BusFlags("TcmdBufferOverrun", unknown_telemetry="UartProtocolError"),
    i2c=BusFlags("TcmdBufferOverrun"),
    protocol_error="UartProtocolError",
    incomplete="UartMsgIncomplete",
    read_without_id="I2cTlmReadError",
)


class NodeLink(SatelliteLink):
    """Queues jobs for telecommands, and for results that schedule a measurement."""

    state: State

    def __init__(self, queue: JobQueue, telemetry: Telemetry) -> None:
        """Fill ``queue``; ``telemetry`` provides values, and its state is used here too."""
        hardware, state = telemetry.hardware, telemetry.state
        super().__init__(hardware, telemetry.meter, state, INTERFACE, _FLAGS, SEND_BYTES)
        self._mcu_addressing = hardware.mcu_addressing
        self._queue = queue
        self._telemetry = telemetry
        self._download = telemetry.download
        self._latest: TelecommandJob | None = None

    # --- telemetry --------------------------------------------------------------------------------

    def _transmit(self, frame: bytes) -> None:
        self.meter.charge(uart_interrupt=len(frame))
        super()._transmit(frame)

    def _read_telemetry(self, identifier: int, bus: BusFlags) -> bytes | None:
        self.state.telemetries += 1
        return super()._read_telemetry(identifier, bus)

    def _values(self, message: Message) -> dict[str, Any]:
        return self._telemetry.values(message)

    def _uart_answer(self, identifier: int) -> bool:
        sent = super()._uart_answer(identifier)
        if sent:
            self._note_read(identifier)
        return sent

    def i2c_start(self, read: bool) -> None:
        """Interrupt: the node is addressed; a repeated start ends the previous message."""
        self.i2c_stop()
        super().i2c_start(read)

    def _finish_read(self) -> None:
        """An answer is used up once a part of it was read."""
        if self._position and self._answer is not None:
            super()._finish_read()
            self._note_read(self._requested)

    def _note_read(self, identifier: int) -> None:
        """The host has read a telemetry message, which may schedule a measurement."""
        if identifier not in SCHEDULES:
            return
        camera, sram = SCHEDULES[identifier]
        if self._queue.put(Measure(camera, sram, detect=True)):
            self.state.schedule(camera, sram, detect=True)
            self.hardware.wake()
        else:
            self.state.raise_flag("TcmdBufferOverrun")

    # --- telecommands -----------------------------------------------------------------------------

    def _accept(self, identifier: int, parameters: bytes, bus: BusFlags) -> AckError:
        """Check a telecommand and queue it; update telemetry TcmdProcessed."""
        self.state.telecommands += 1
        if self._latest is not None:
            self._latest.latest = False
        self._latest = None
        error = super()._accept(identifier, parameters, bus)
        self.state.last_command = identifier
        self.state.last_error = error
        self.state.last_processed = int(error is not AckError.OK)
        return error

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str | None]:
        return super()._refusals(message, values) or [None] * (not self._possible(message, values))

    def _possible(self, message: Message, values: dict[str, Any]) -> bool:
        """Checks of a telecommand's parameters that the table cannot express."""
        match message.name:
            case "NextImageFrame":
                return self._download.has(int(values["Frame"]))
            case "Distortion1" | "Distortion2":
                return invertible(distortion_of(values), self.meter)
            case "SetNadirSearch":
                return values["Search"] == codes.NadirSearch.LINES or self._mcu_addressing
        return True

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        if self._queue.full:
            return False
        self._latest = TelecommandJob(message, values, latest=True)
        self._announce(self._latest)
        return self._queue.put(self._latest)

    def _announce(self, job: TelecommandJob) -> None:
        values = job.values
        match job.message.name:
            case "CaptureAndDetect" | "CaptureOnly":
                detect = job.message.name == "CaptureAndDetect"
                self.state.schedule(
                    codes.Camera(values["Camera"]), codes.Sram(values["Sram"]), detect=detect
                )
            case "StartImageDownload" | "NextImageFrame":
                job.frame = self._download.request(values)
