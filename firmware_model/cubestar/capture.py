"""Image capture: discarding the first frame, FPGA store and transfer.

CubeStar thesis, section 5.3.1 and appendix D: getImage calls imagerEnable, waits, calls
fpgaWriteToRam and imageTransfer. The previous image is processed while the FPGA waits for the new
frame (section 5.3.6).
"""

from dataclasses import dataclass

from cubestack.firmware_model.cubestar import phases
from cubestack.firmware_model.cubestar.image_memory import ImageMemory
from cubestack.firmware_model.cubestar.image_sensor import ImageSensor
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.firmware_model.mcu.requests import AwaitPin, ReadTimer, Routine, Sleep

ACK_POLL_CYCLES = 8  #: port read (3) and loop step (5) of the cost table
LATE_US = 1  #: an ACK seen by the first poll rose before
ACK_TIMEOUT_US = 2_000_000  #: more than two frames at the lowest frame rate; assumed


@dataclass(eq=False)
class ImageCapture:
    """The capture functions, with the settings in ``state``."""

    state: State
    supply: SupplyMonitor
    sensor: ImageSensor
    memory: ImageMemory

    def get_image(self, meanwhile: Routine[bool] | None = None) -> Routine[bool]:
        """Capture an image; raises a flag and returns False if it failed.

        ``meanwhile`` runs while the FPGA waits for the frame, or at once if no frame can come.
        After a failure there is no image to process.
        """
        state = self.state
        failure = yield from self._enable_sensor()
        if failure is None:
            failure = yield from self._store_frame(meanwhile)
        elif meanwhile is not None:
            yield from meanwhile
        if failure is None:
            started_us: int = yield ReadTimer()
            if (yield from self.memory.fetch()):
                yield from phases.end(self.state, "transfer_us", started_us)
            if self.supply.cut:  # during the transfer
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

    def mark_replaced(self) -> Routine[bool]:
        """An upload or test pattern replaced the image; returns False if its supply was cut."""
        now_us: int = yield ReadTimer()
        self.state.retained.image_ms = now_us // 1000
        self.state.earlier.note_time(None)
        self.state.retained.image_present = int(not self.supply.cut)
        self.state.retained.frame += 1
        return not self.supply.cut

    def _enable_sensor(self) -> Routine[str | None]:
        """Start the sensor and wait for its first, invalid frame; returns a failure's flag."""
        failure = yield from self.sensor.configure()
        if failure is not None:
            return failure
        self.state.task_status = TaskStatus.CAPTURING
        if not (yield from self.sensor.enable(True)):
            return "ISEnableError"
        phases.begin_capture(self.state)
        enabled_us: int = yield ReadTimer()
        delay_ms = self.state.settings.get("SetDiscardDelay", "Delay")
        yield Sleep(enabled_us + 1000 * delay_ms, wakeable=False)
        yield from phases.end(self.state, "discard_us", enabled_us)
        return None

    def _store_frame(self, meanwhile: Routine[bool] | None) -> Routine[str | None]:
        """Let the FPGA store a frame (fpgaWriteToRam); returns a failure's flag.

        The image's time is that of ACK's poll, which is late if ``meanwhile`` outlasts the frame.
        """
        started_us: int = yield ReadTimer()
        yield from self.memory.begin()
        self.supply.sample()
        if meanwhile is not None:
            yield from meanwhile
        awaiting_us: int = yield ReadTimer()
        pin = self.memory.acknowledge
        stored: bool = yield AwaitPin(pin, 1, ACK_TIMEOUT_US, ACK_POLL_CYCLES)
        acknowledged_us: int = yield ReadTimer()
        yield from self.memory.end(stored)
        yield from phases.end(self.state, "capture_us", started_us)
        ended_us: int = yield ReadTimer()
        age_us = self.sensor.age_at_frame_end_us()
        self.state.retained.image_ms = (ended_us - age_us) // 1000
        seen = acknowledged_us > awaiting_us + LATE_US
        self.state.earlier.note_time(acknowledged_us - age_us if seen else None)
        if not (yield from self.sensor.enable(False)):
            self.state.raise_flag("ISDisableError")  # the image is valid nevertheless
            self.sensor.forget_set_up()
        return None if stored else "ImageCaptureError"
