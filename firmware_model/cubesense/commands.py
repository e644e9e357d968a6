"""Effects of the jobs, which the main loop executes one after the other.

A setting takes effect from the next measurement on. Telecommand Reset restarts the communication
(its counters, its flags and the selected image), the cameras, or the whole program; the latter
discards waiting telecommands.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.camera_control import CameraControl
from cubestack.firmware_model.cubesense.download import Download, ImageReader
from cubestack.firmware_model.cubesense.jobs import Background, Job, Measure, TelecommandJob
from cubestack.firmware_model.cubesense.measurement import Measurement, make_table
from cubestack.firmware_model.cubesense.state import CameraSettings, State, distortion_of
from cubestack.firmware_model.cubesense.supply import Supply
from cubestack.firmware_model.cubesense.vision.distortion import DistortionError
from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Routine
from cubestack.firmware_model.node.state import SWITCH_COMMANDS

SOFTWARE_RESET = 1  #: cause of the program's own reset

_SETTINGS = {
    f"{name}{camera + 1}": (name, camera)
    for name in (
        "DetectionThreshold",
        "AutoAdjust",
        "CameraSettings",
        "Boresight",
        "Mask",
        "Distortion",
    )
    for camera in codes.Camera
}
"""Setting and camera, by telecommand."""


@dataclass(eq=False)
class Commands:
    """Executes jobs."""

    meter: Meter
    state: State
    supply: Supply
    cameras: CameraControl
    acquisition: Acquisition
    measurement: Measurement

    def __post_init__(self) -> None:
        self.reader = ImageReader(self.acquisition)  #: reads images, for every stream
        self.download = Download(self.meter, self.reader)  #: the frame that telemetry returns
        self._routines: dict[str, Callable[[TelecommandJob], Routine[int | None]]] = {
            "Reset": self._reset,
            "ClearOverCurrent": self._clear_over_current,
            "CaptureAndDetect": self._capture,
            "CaptureOnly": self._capture,
            "StartImageDownload": self._prepare_frame,
            "NextImageFrame": self._prepare_frame,
            "SetNadirSearch": self._set_search,
        }
        #: names of the telecommands that have an effect
        self.handled = frozenset({*self._routines, *_SETTINGS, *SWITCH_COMMANDS})

    def execute(self, job: Job) -> Routine[int | None]:
        """Execute ``job``; returns a cause if the program must reset."""
        cause = None
        match job:
            case TelecommandJob():
                cause = yield from self._telecommand(job)
            case Measure():
                yield from self.measurement.measure(job.camera, job.sram, detect=job.detect)
            case Background():
                yield from job.work()
        yield Pay()
        return cause

    def _telecommand(self, job: TelecommandJob) -> Routine[int | None]:
        name = job.message.name
        cause = None
        if name in _SETTINGS:
            setting, camera = _SETTINGS[name]
            self.meter.charge(i8=job.message.length)
            self._set(setting, self.state.cameras[camera], job.values)
        elif name in SWITCH_COMMANDS:
            self.state.switches.change(name, job.values)
        else:
            cause = yield from self._routines[name](job)
        yield Pay()
        if job.latest and cause is None:
            self.state.last_processed = 1
        return cause

    def _reset(self, job: TelecommandJob) -> Routine[int | None]:
        match job.values["Target"]:
            case codes.ResetTarget.COMMUNICATION:
                self.state.reset_communication()
                self.download.forget()
            case codes.ResetTarget.CAMERAS:
                yield from self.cameras.restart()
            case codes.ResetTarget.MCU:
                return SOFTWARE_RESET
        return None

    def _clear_over_current(self, job: TelecommandJob) -> Routine[None]:
        selection = job.values["Selection"]
        memories = [s for s in codes.Sram if selection in (s, codes.SramSelection.BOTH)]
        yield from self.supply.clear_over_current(*memories)

    def _capture(self, job: TelecommandJob) -> Routine[None]:
        camera, sram = codes.Camera(job.values["Camera"]), codes.Sram(job.values["Sram"])
        detect = job.message.name == "CaptureAndDetect"
        yield from self.measurement.measure(camera, sram, detect=detect)

    def _prepare_frame(self, job: TelecommandJob) -> Routine[None]:
        if job.frame is not None:
            yield from self.download.prepare(job.frame)

    def _set_search(self, job: TelecommandJob) -> Routine[None]:
        self.state.nadir_search = codes.NadirSearch(job.values["Search"])
        yield Pay()

    def _set(self, setting: str, settings: CameraSettings, values: dict[str, Any]) -> None:
        match setting:
            case "DetectionThreshold":
                settings.threshold = values["Threshold"]
            case "AutoAdjust":
                settings.auto_adjust = values["Enabled"]
            case "CameraSettings":
                settings.exposure, settings.gain = values["Exposure"], values["Gain"]
                settings.blue_gain, settings.red_gain = values["BlueGain"], values["RedGain"]
            case "Boresight":
                settings.boresight = (values["X"], values["Y"])
            case "Mask":
                limits = (values[name] for name in ("XMin", "XMax", "YMin", "YMax"))
                settings.masks[values["Area"] - 1] = Mask(*limits)
            case "Distortion":
                self._set_distortion(settings, distortion_of(values))

    def _set_distortion(self, settings: CameraSettings, factors: tuple[float, ...]) -> None:
        """Store factors that allow every table; the quick check may be wrong about some.

        The measurement that needs a table first is charged for it.
        """
        try:
            for kind in CubeSenseSwitches.declared()["distortion"].choices:
                switches = CubeSenseSwitches(distortion=kind)
                make_table(codes.Camera.NADIR, switches, factors, Meter(self.meter.table))
        except DistortionError:
            self.state.last_error = AckError.BAD_PARAMETER
        else:
            settings.distortion = factors
