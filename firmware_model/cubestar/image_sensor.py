"""The firmware's use of the image sensor: set-up for stars, enable, single registers.

CubeStar thesis, appendix D; register names and addresses are those of the sensor's own table.
"""

from dataclasses import dataclass

from cubestack.firmware_model.cubestar import phases
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.cameras import mlx75412
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.firmware_model.mcu.requests import CameraTransfer, ReadTimer, Routine, pause

SETTLE_US = 2_000  #: from power-up to the first register access; assumed

_REST = REGISTERS["MODE_SELECT"].value(OUTPUT_DEPTH=1)
_GATHER = _REST | REGISTERS["MODE_SELECT"].value(ENABLE=1)
_ALL_BUT_SHARPENING = REGISTERS["HARDWARE_FEATURES"].value(
    DEFECT_CORRECTION=1, FPN_CORRECTION=1, DARK_SUBTRACTION=1, HISTOGRAM_REMAP=1
)
_AUTOVIEW_ONLY = REGISTERS["FIRMWARE_FEATURES"].value(AUTOVIEW=1)


@dataclass(eq=False)
class ImageSensor:
    """Register access over the camera's own control bus."""

    state: State  #: its settings determine the sensor's set-up
    #: address and value of the register read last; value None: no answer
    selected_register: tuple[int, int | None] = (0, None)

    def power_up(self) -> Routine[None]:
        """Wait after power-up; the registers are at their reset values."""
        yield from pause(SETTLE_US)
        self.state.retained.camera_setup = 0

    def forget_set_up(self) -> None:
        """After a failure the sensor may have lost its supply: set it up again next time.

        Appendix D sets the registers up before images, and the software reset of section 5.3.6
        erases the published program's memory of it.
        """
        self.state.retained.camera_setup = 0

    def configure(self) -> Routine[str | None]:
        """Set up for stars if needed; returns the flag of an unanswered write."""
        retained, settings = self.state.retained, self.state.settings
        rate = settings.get("SetFrameRate", "FrameRate")
        exposure = settings.get("Exposure", "exposure")
        wanted = rate << 16 | exposure
        if retained.camera_setup == wanted:
            return None
        failure = "ConfigChangeError" if retained.camera_setup else "ISSetupError"
        retained.camera_setup = 0  # until all registers are written
        set_up = {
            "MODE_SELECT": _REST,
            "HARDWARE_FEATURES": _ALL_BUT_SHARPENING,
            "LINEARITY": 0,
            "FRAMES_PER_SECOND": rate,
            "FIRMWARE_FEATURES": _AUTOVIEW_ONLY,
        }
        exposing = {
            "EXPOSURE_RULE": 0 if exposure else mlx75412.LONGEST_EXPOSURE,
            "EXPOSURE": exposure,
            "SYNC": mlx75412.SYNC_APPLY,
        }
        self.state.task_status = TaskStatus.CAMERA_INITIALISING
        started_us: int = yield ReadTimer()
        if not (yield from self._write_all(set_up)):
            self.state.task_status = TaskStatus.CAMERA_FAILED
            return failure
        self.state.task_status = TaskStatus.CAMERA_INITIALISED
        exposing_us: int = yield ReadTimer()
        if not (yield from self._write_all(exposing)):
            self.state.task_status = TaskStatus.CAMERA_FAILED
            return failure
        yield from phases.end(self.state, "exposure_setup_us", exposing_us)
        yield from phases.end(self.state, "camera_setup_us", started_us)
        retained.camera_setup = wanted
        return None

    def apply_settings(self) -> Routine[bool]:
        """Run ``configure`` and raise its flag; False if there was no answer."""
        failure = yield from self.configure()
        if failure is not None:
            self.state.raise_flag(failure)
        return failure is None

    def _write_all(self, values: dict[str, int]) -> Routine[bool]:
        for register, value in values.items():
            if not (yield from self._write(register, value)):
                return False
        return True

    def enable(self, on: bool) -> Routine[bool]:
        """Enable or disable image capture; False if the sensor does not answer."""
        return (yield from self._write("MODE_SELECT", _GATHER if on else _REST))

    def _write(self, register: str, value: int) -> Routine[bool]:
        declared = REGISTERS[register]
        return (yield from self._transfer(declared.address, value.to_bytes(declared.width, "big")))

    def write_byte(self, address: int, value: int) -> Routine[None]:
        """Write any byte; an unanswered write raises ConfigChangeError.

        The next capture sets the sensor up again only if a setting changed.
        """
        if not (yield from self._transfer(address, bytes([value]))):
            self.state.raise_flag("ConfigChangeError")

    def _transfer(self, address: int, data: bytes) -> Routine[bool]:
        head = address.to_bytes(REGISTERS.address_bytes, "big")
        return (yield CameraTransfer(head + data)) is not None

    def select_register(self, address: int) -> Routine[None]:
        """Read any byte into ``selected_register``; an unanswered read raises ISSetupError."""
        head = address.to_bytes(REGISTERS.address_bytes, "big")
        answer: bytes | None = yield CameraTransfer(head, read=1)
        self.selected_register = (address, None if answer is None else answer[0])
        if answer is None:
            self.state.raise_flag("ISSetupError")

    def age_at_frame_end_us(self) -> int:
        """Time from the mid-exposure of the middle row to the end of a frame's read-out, in us.

        The sensor shortens an exposure that does not fit the frame.
        """
        rate = self.state.settings.get("SetFrameRate", "FrameRate")
        exposure = self.state.settings.get("Exposure", "exposure")
        line = mlx75412.LINE_CLOCKS
        longest = round(REGISTERS["CLOCKS_PER_SECOND"].reset / (rate * line)) - 1
        lines = mlx75412.ROWS / 2 + min(exposure or longest, longest) / 2
        return int(lines * line * 1_000_000 / mlx75412.CRYSTAL_HZ)
