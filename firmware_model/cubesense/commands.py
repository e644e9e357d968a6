"""What each job does, executed by the main loop one after the other.

A setting counts from the next measurement on. Telecommand Reset restarts the communication (its
counters, its flags and the selected picture), the cameras, or the whole program; telecommands that
still wait are lost with the latter.
"""

from collections.abc import Callable
from typing import Any

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.camera_control import CameraControl
from cubestack.firmware_model.cubesense.download import Download, PictureReader
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.jobs import Background, Job, Measure, TelecommandJob
from cubestack.firmware_model.cubesense.measurement import Measurement
from cubestack.firmware_model.cubesense.state import CameraSettings, State, distortion_of
from cubestack.firmware_model.cubesense.supply import Supply
from cubestack.firmware_model.cubesense.vision import distortion
from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Routine

SOFTWARE_RESET = 1
"""Cause of the program's own reset."""

Values = Any


class Commands:
    """Executes jobs.

    Attributes:
        reader: reads pictures, for every stream.
        download: the frame that telemetry hands out.
        handled: names of the telecommands that have an effect.
    """

    def __init__(
        self,
        hardware: CubeSenseHardware,
        meter: Meter,
        state: State,
        supply: Supply,
        cameras: CameraControl,
        acquisition: Acquisition,
        measurement: Measurement,
    ) -> None:
        """Act on the given parts of the program."""
        self._meter = meter
        self._state = state
        self._supply = supply
        self._cameras = cameras
        self._measurement = measurement
        self.reader = PictureReader(acquisition)
        self.download = Download(meter, self.reader)
        self._settings: dict[str, Callable[[CameraSettings, Values], None]] = {
            "DetectionThreshold": self._set_threshold,
            "AutoAdjust": self._set_auto_adjust,
            "CameraSettings": self._set_camera,
            "Boresight": self._set_boresight,
            "Mask": self._set_mask,
            "Distortion": self._set_distortion,
        }
        self._routines: dict[str, Callable[[TelecommandJob], Routine[int | None]]] = {
            "Reset": self._reset,
            "ClearOverCurrent": self._clear_over_current,
            "CaptureAndDetect": self._capture,
            "CaptureOnly": self._capture,
            "StartImageDownload": self._prepare_frame,
            "NextImageFrame": self._prepare_frame,
            "SetNadirSearch": self._set_search,
        }
        self._cameras_by_setting = {
            f"{name}{camera + 1}": (name, camera)
            for name in self._settings
            for camera in codes.Camera
        }
        self.handled = frozenset({*self._routines, *self._cameras_by_setting})

    def execute(self, job: Job) -> Routine[int | None]:
        """Do ``job``; returns a cause when the program has to end in a reset."""
        cause = None
        match job:
            case TelecommandJob():
                cause = yield from self._telecommand(job)
            case Measure():
                yield from self._measurement.measure(job.camera, job.sram, detect=job.detect)
            case Background():
                yield from job.work()
        yield Pay()
        return cause

    def _telecommand(self, job: TelecommandJob) -> Routine[int | None]:
        name = job.message.name
        cause = None
        if name in self._cameras_by_setting:
            setting, camera = self._cameras_by_setting[name]
            self._meter.charge(i8=job.message.length)
            self._settings[setting](self._state.cameras[camera], job.values)
        else:
            cause = yield from self._routines[name](job)
        yield Pay()
        if job.latest and cause is None:
            self._state.last_processed = 1
        return cause

    # --- node ---------------------------------------------------------------------------------

    def _reset(self, job: TelecommandJob) -> Routine[int | None]:
        match codes.ResetTarget(job.values["Target"]):
            case codes.ResetTarget.COMMUNICATION:
                self._state.reset_communication()
                self.download.forget()
            case codes.ResetTarget.CAMERAS:
                yield from self._cameras.restart()
            case codes.ResetTarget.MCU:
                return SOFTWARE_RESET
        return None

    def _clear_over_current(self, job: TelecommandJob) -> Routine[None]:
        selection = codes.SramSelection(job.values["Selection"])
        both = selection is codes.SramSelection.BOTH
        yield from self._supply.clear_over_current(
            *(codes.Sram if both else [codes.Sram(selection)])
        )

    # --- pictures -----------------------------------------------------------------------------

    def _capture(self, job: TelecommandJob) -> Routine[None]:
        camera, sram = codes.Camera(job.values["Camera"]), codes.Sram(job.values["Sram"])
        detect = job.message.name == "CaptureAndDetect"
        yield from self._measurement.measure(camera, sram, detect=detect)

    def _prepare_frame(self, job: TelecommandJob) -> Routine[None]:
        if job.frame is not None:
            yield from self.download.prepare(job.frame)

    # --- settings -----------------------------------------------------------------------------

    def _set_search(self, job: TelecommandJob) -> Routine[None]:
        self._state.nadir_search = codes.NadirSearch(job.values["Search"])
        yield Pay()

    @staticmethod
    def _set_threshold(settings: CameraSettings, values: Values) -> None:
        settings.threshold = values["Threshold"]

    @staticmethod
    def _set_auto_adjust(settings: CameraSettings, values: Values) -> None:
        settings.auto_adjust = values["Enabled"]

    @staticmethod
    def _set_camera(settings: CameraSettings, values: Values) -> None:
        settings.exposure, settings.gain = values["Exposure"], values["Gain"]
        settings.blue_gain, settings.red_gain = values["BlueGain"], values["RedGain"]

    @staticmethod
    def _set_boresight(settings: CameraSettings, values: Values) -> None:
        settings.boresight = (values["X"], values["Y"])

    @staticmethod
    def _set_mask(settings: CameraSettings, values: Values) -> None:
        limits = (values[name] for name in ("XMin", "XMax", "YMin", "YMax"))
        settings.masks[values["Area"] - 1] = Mask(*limits)

    def _set_distortion(self, settings: CameraSettings, values: Values) -> None:
        """Keep factors of which the tables can be made; the quick check may be wrong about some.

        Making one is charged to the measurement that needs it first.
        """
        factors = distortion_of(values)
        try:
            for projection in distortion.Projection:
                distortion.fine_table(Meter(self._meter.table), projection, factors)
        except distortion.DistortionError:
            self._state.last_error = AckError.BAD_PARAMETER
        else:
            settings.distortion = factors
