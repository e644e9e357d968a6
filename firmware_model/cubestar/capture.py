"""Image capture: discarding the first frame, FPGA store and transfer.

CubeStar thesis, section 5.3.1 and appendix D: getImage calls imagerEnable, waits, calls
fpgaWriteToRam and imageTransfer. The previous image is processed while the FPGA waits for the new
frame (section 5.3.6).
"""

from cubestack.firmware_model.cubestar.image_sensor import ImageSensor
from cubestack.firmware_model.cubestar.phases import Phases
from cubestack.firmware_model.cubestar.pictures.contract import Pictures
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.firmware_model.mcu.requests import AwaitPin, ReadTimer, Routine, Sleep

ACK_POLL_CYCLES = 8
"""Port read (3) and loop step (5) of the cost table."""

ACK_TIMEOUT_US = 2_000_000
"""More than two frames at the lowest frame rate; the sources give no limit."""


class ImageCapture:
    """The capture functions.

    Attributes:
        sensor: the image sensor.
        pictures: where the newest picture lies.
    """

    def __init__(
        self, state: State, phases: Phases, supply: SupplyMonitor, pictures: Pictures
    ) -> None:
        """Capture into ``pictures`` as the settings in ``state`` say."""
        self._state = state
        self._phases = phases
        self._supply = supply
        self.sensor = ImageSensor(state, phases)
        self.pictures = pictures

    def get_image(self, meanwhile: Routine[bool] | None = None) -> Routine[bool]:
        """Capture a picture; False, with a flag raised, when it failed.

        ``meanwhile`` runs while the FPGA waits for the frame, or at once when there will be none.
        After a failure there is no picture to process.
        """
        state = self._state
        state.task_status = TaskStatus.CAPTURING
        failure = yield from self._enable_sensor()
        if failure is None:
            failure = yield from self._store_frame(meanwhile)
        elif meanwhile is not None:
            yield from meanwhile
        if failure is None:
            yield from self._image_transfer()
            if self._supply.cut:  # while the picture was on its way
                failure = "ImageCaptureError"
        if failure is not None:
            state.raise_flag(failure)
            self.sensor.forget_set_up()
            state.retained.image_present = 0
            state.task_status = TaskStatus.CAPTURE_FAILED
            return False
        state.retained.image_present = 1
        state.retained.frame += 1
        state.task_status = TaskStatus.CAPTURED
        return True

    def replaced(self) -> Routine[None]:
        """The picture was made by other means than a capture."""
        now_us: int = yield ReadTimer()
        self._state.retained.image_ms = now_us // 1000
        self._state.retained.image_present = 1
        self._state.retained.frame += 1

    def _enable_sensor(self) -> Routine[str | None]:
        """Start the sensor and let its first, invalid frame pass; returns a failure's flag."""
        failure = yield from self.sensor.configure()
        if failure is not None:
            return failure
        if not (yield from self.sensor.enable(True)):
            return "ISEnableError"
        self._phases.begin_capture()
        enabled_us: int = yield ReadTimer()
        delay_us = 1000 * self._state.settings.get("SetDiscardDelay", "Delay")
        yield Sleep(enabled_us + delay_us, wakeable=False)
        yield from self._phases.end("discard_us", enabled_us)
        return None

    def _store_frame(self, meanwhile: Routine[bool] | None) -> Routine[str | None]:
        """Have the FPGA store a frame (fpgaWriteToRam); returns a failure's flag.

        The picture's time is that of ACK's poll: late by as much as ``meanwhile`` outlasts the
        frame.
        """
        started_us: int = yield ReadTimer()
        yield from self.pictures.begin()
        self._supply.sample()
        if meanwhile is not None:
            yield from meanwhile
        acknowledge = self.pictures.acknowledge
        stored: bool = yield AwaitPin(acknowledge, 1, ACK_TIMEOUT_US, ACK_POLL_CYCLES)
        yield from self.pictures.end(stored)
        yield from self._phases.end("capture_us", started_us)
        ended_us: int = yield ReadTimer()
        self._state.retained.image_ms = (ended_us - self.sensor.age_at_frame_end_us()) // 1000
        if not (yield from self.sensor.enable(False)):
            self._state.raise_flag("ISDisableError")  # the picture is good all the same
            self.sensor.forget_set_up()
        return None if stored else "ImageCaptureError"

    def _image_transfer(self) -> Routine[None]:
        """Copy the frame to where the program works on it (imageTransfer)."""
        started_us: int = yield ReadTimer()
        if (yield from self.pictures.fetch()):
            yield from self._phases.end("transfer_us", started_us)
