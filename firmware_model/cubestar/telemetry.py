"""Values of every telemetry frame, computed at the request."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import angles_of
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.cubestar.commands import Commands
from cubestack.firmware_model.cubestar.processing.bodies import NO_BODIES
from cubestack.firmware_model.cubestar.processing.gyro import NO_RATE
from cubestack.firmware_model.cubestar.star_reports import StarReports, Values, by_name
from cubestack.firmware_model.cubestar.state import Attitude
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import SHOWN, shown_values
from cubestack.firmware_model.interface.cubestar import INTERFACE, ImageBlockSize, SwitchState
from cubestack.firmware_model.interface.cubestar.flags import flag_fields
from cubestack.firmware_model.node.state import SERIAL_NUMBER, identification

NODE_TYPE = INTERFACE.node_type

PROCESSING_LIMIT_MS = 500  #: CubeStar thesis, section 5.3.6


def _of(command: str, *fields: str, **renamed: str) -> dict[str, tuple[str, str]]:
    """Parameters of ``command`` by the name of their telemetry field, ``renamed`` or not."""
    shown = {field: field for field in fields} | renamed
    return {name: (command, field) for name, field in shown.items()}


#: Telemetry that shows settings: for each field the setting telecommand and its parameter.
SETTINGS_SHOWN = {
    "Exposure": _of("Exposure", "exposure"),
    "FocalLengthDetails": _of("setFocalLength", "FocalLength")
    | _of("setFocalLengthComponents", "Fx", "Fy"),
    "PrincipalPoint": _of("setPrincipalPoint", "Cx", "Cy"),
    "DistortionCoef": _of("setRadialDistortionGains", "K1", "K2")
    | _of("setTangentalDistortionGains", "P1", "P2"),
    "DetectionRegion": _of("setDetectionRegion", "StepSize", "Xstart", "Xend", "Ystart", "Yend"),
    "StarPixels": _of("setStarPixels", "MinPixels", "MaxPixels"),
    "StarGrid": _of("setDetectionVariables", "GridSize"),
    "MaxStars": _of(
        "setDetectionVariables",
        maxStars="MaxStars",
        maxInvalidStars="MaxInvalidStars",
        maxNoise="MaxNoise",
    ),
    "IDMode": _of("setIDMode", Mode="IdMode"),
    "IDMargin": _of("setIDMargin", "Margin"),
    "DelayTime": _of("setDelayTimerTimeout", Timeout="Time"),
}

#: Telemetry that shows times in ms: for each field the step of ``Processing``; the longest time if
#: the field's name begins with Max, else the latest.
TIMES_SHOWN = {
    "DetectionTimingOne": {
        "MaxStarSearchTime": "search",
        "MaxCentroidFindTime": "centroid",
        "MaxCorrectionTime": "correction",
        "MaxVectorCalTime": "vectors",
    },
    "DetectionTimingTwo": dict.fromkeys(("StarDetectionTime", "MaxStarDetectionTime"), "detection"),
    "IDTimingOne": {
        "MaxModeSelectionTime": "reduction",
        "MaxDistanceCalTime": "distances",
        "MaxVoteRoundOneTime": "votes",
        "MaxFindIDTime": "identities",
    },
    "IDTimingTwo": {
        "MaxVoteRoundTwoTime": "verification",
        "MaxSelectID": "selection",
        "MaxAlgoCompletionTime": "identification",
    },
    "IDTimingThree": {
        "StarIdentificationTime": "identification",
        "MaxStarIdentificationTime": "identification",
    },
    "BestStarSelectionTime": {"LatestTime": "best", "MaxTime": "best"},
    "AttitudeTiming": {"LatestTime": "attitude", "MaxTime": "attitude"},
}

#: Telemetry of times in ``Retained``: for each field, the phases whose sum it shows.
_PHASES_SHOWN: dict[str, dict[str, tuple[str, ...]]] = {
    "CameraTiming": {
        "SetupTime": ("camera_setup",),
        "ExposureUpdateTime": ("exposure_setup",),
        "CaptureTime": ("discard", "capture"),
    },
    "TimingSummary": {
        "ImageCaptureTime": ("discard", "capture", "transfer"),
        "DetectionTime": ("detect",),
        "IdentificationTime": ("match",),
    },
    "PhaseTimes": {
        **{name: (name.lower(),) for name in ("Idle", "Discard", "Capture", "Transfer")},
        **{name: (name.lower(),) for name in ("Detect", "Match", "Attitude")},
        "LoopTotal": ("loop",),
    },
}


class Telemetry:
    """Answers telemetry requests; interrupt context, so nothing here waits.

    Without any attitude the quaternion is that of no rotation.
    """

    def __init__(self, commands: Commands, pending: Callable[[], bool]) -> None:
        self._commands = commands
        self._processing, self._state = processing, state = commands.processing, commands.state
        self._hardware = hardware = state.hardware
        self._capture = processing.capture
        self._stars = StarReports(processing)
        self._sources: dict[str, Callable[[], Values]] = {
            "Identification": lambda: identification(INTERFACE, NODE_TYPE, hardware.uptime_us()),
            "ExtendedIdentification": self._extended_identification,
            "ErrorFlags": state.flag_values,
            "TcmdProcessed": lambda: {"Processed": int(not pending() and not commands.running)},
            "TaskStatus": lambda: {"taskStatus": state.task_status},
            "StartAndLoopTime": self._loop_times,
            "SRAMTestResults": lambda: {"TestResult": commands.memory_test},
            "PowerStatus": lambda: {"Status": self._switch(), **self._currents()},
            "ImageSetup": INTERFACE.telemetry("ImageSetup").reset_values,
            "IS_Register": lambda: {"DataH": 0, "DataL": self._camera_register()["Value"]},
            "ImageBlock": self._image_block,
            "DetectionThresholdValues": self._thresholds,
            "LogStatus": self._log_status,
            "UploadStatus": lambda: {
                "NextBlock": commands.next_block,
                "BlocksReceived": commands.blocks_received,
            },
            "SupplyReport": self._supply_report,
            "CameraRegister": self._camera_register,
            "LoopStatus": self._loop_status,
            "Quaternion": self._quaternion,
            "SphereicalCoordinates": lambda: self._angles(self._boresight()),
            "AttitudeData": self._attitude_data,
            "AttitudeQuaternion": self._attitude_quaternion,
            "PerformanceParameters": self._performance,
            "Results": self._counts,
            "Quality": lambda: state.quality,
            "Bodies": lambda: processing.results.bodies or NO_BODIES,
            "StellarGyro": lambda: processing.results.rate or NO_RATE,
            SHOWN: lambda: shown_values(state.switches.now),
            **self._stars.sources,
        }

    def values(self, message: Message) -> Values | None:
        """Values of every field of ``message``; None if the node does not support it."""
        if shown := SETTINGS_SHOWN.get(message.name):
            return {name: self._state.settings.get(*setting) for name, setting in shown.items()}
        if steps := TIMES_SHOWN.get(message.name):
            latest, longest = self._processing.latest_ms, self._processing.longest_ms
            return {
                name: (longest if name.startswith("Max") else latest).get(step, 0.0)
                for name, step in steps.items()
            }
        if phases := _PHASES_SHOWN.get(message.name):
            unit_us = 1000 if message.fields[0].unit == "ms" else 1
            retained = self._state.retained
            return {
                name: sum(getattr(retained, f"{phase}_us") for phase in summed) / unit_us
                for name, summed in phases.items()
            }
        source = self._sources.get(message.name)
        return None if source is None else source()

    # --- node ---------------------------------------------------------------------------------

    def _extended_identification(self) -> Values:
        retained = self._state.retained
        return {
            "SerialNumber": SERIAL_NUMBER,
            "Temperature": self._hardware.temperature_c(),
            "ResetCause": self._state.reset_cause,
            "WDGResetCount": retained.watchdog_resets,
            "TcmdCount": retained.telecommands & 0xFFFF,
            "TlmCount": retained.telemetry & 0xFFFF,
        }

    def _loop_times(self) -> Values:
        return {
            "StartupTime": self._state.startup_us / 1000,
            "LoopTime": self._state.retained.loop_us / 1000,
            "MaxLoopTime": self._state.retained.longest_loop_us / 1000,
        }

    def _switch(self) -> SwitchState:
        return SwitchState.ON if self._capture.supply.imager_on else SwitchState.OFF

    def _currents(self) -> Values:
        return {
            "Current": self._capture.supply.sample(),
            "MaxCurrent": self._state.retained.highest_ua / 1000,
            "MinCurrent": self._state.retained.lowest_ua / 1000,
        }

    def _log_status(self) -> Values:
        return {
            "Temp": self._hardware.temperature_c(),
            "Runtime": self._hardware.uptime_us() // 1_000_000,
            "WDGcounter": self._state.retained.watchdog_resets,
            "Status": self._state.task_status,
            "SW": self._switch(),
            **self._currents(),
            **{f.name: f.flag in self._state.flags for f in flag_fields(log_names=True)},
        }

    def _supply_report(self) -> Values:
        retained = self._state.retained
        return {
            "SramCurrent": self._hardware.supply_current_ma("memory"),
            "ImagerCurrent": self._hardware.supply_current_ma("imager"),
            "LatchUps": retained.latch_ups,
            "PowerCycles": retained.power_cycles,
        }

    def _loop_status(self) -> Values:
        settings, retained = self._state.settings, self._state.retained
        return {
            "Iterations": retained.iterations,
            "ModeFlag": self._state.mode,
            "FrameRate": settings.get("SetFrameRate", "FrameRate"),
            "DiscardDelay": settings.get("SetDiscardDelay", "Delay"),
            "Bank": settings.get("SelectImageBank", "Bank"),
            "CameraPage": settings.get("SetCameraRegisterPage", "Page"),
            "Running": bool(retained.looping),
        }

    # --- camera and image ---------------------------------------------------------------------

    def _camera_register(self) -> Values:
        address, value = self._capture.sensor.selected_register
        return {"Address": address, "Value": value or 0, "Valid": int(value is not None)}

    def _image_block(self) -> Values:
        setting = self._state.settings.all("ImageBlockSet")
        length = ImageBlockSize(setting["BlockSize"]).length
        start = setting["BlockNumber"] * length
        longest = ImageBlockSize.BYTES_128.length
        if length > longest:  # 256 bytes come as two reads
            start += longest if self._commands.second_half else 0
            self._commands.second_half = not self._commands.second_half
        data = self._capture.memory.read_now(start, min(length, longest))
        if data is None:
            self._state.raise_flag("StatusError")
            data = b""
        return {"Block": data.ljust(longest, b"\0")}

    def _thresholds(self) -> Values:
        dark = self._stars.summary()["ImageDarkValue"]
        return {"DarkThreshold": dark, **self._state.settings.all("setDetectionThresholds")}

    # --- attitude, and the outcome of the latest image --------------------------------------------

    def _attitude(self) -> Attitude:
        mode, none = self._processing.results.mode, np.array([0, 0, 0, 1], np.float32)
        return self._state.attitude or Attitude(none, 0, 0, 0, mode)

    def _quaternion(self) -> Values:
        return by_name((f"Qbar{index}" for index in range(4)), self._attitude().quaternion)

    def _boresight(self) -> NDArray[np.float32]:
        return np.asarray(dcm(self._attitude().quaternion, self._processing.meter)[2])

    def _angles(self, boresight: NDArray[np.float32]) -> Values:
        angles = angles_of(boresight, self._processing.meter)
        return by_name(("RightAscension", "Declination"), angles)

    def _attitude_data(self) -> Values:
        boresight = self._boresight()
        vector = by_name(("BSVX", "BSVY", "BSVZ"), boresight)
        return {**self._quaternion(), **self._angles(boresight), **vector}

    def _attitude_quaternion(self) -> Values:
        attitude = self._attitude()
        return {
            **by_name(("Q0", "Q1", "Q2", "Q3"), attitude.quaternion),
            "FrameCounter": attitude.frame,
            "ImageTime": attitude.image_ms,
            "Mode": attitude.mode,
            "Matched": attitude.matched,
            "Valid": bool(self._state.retained.solved),
        }

    def _counts(self) -> Values:
        summary, identification = self._stars.summary(), self._processing.results.identification
        return {
            "DarkValue": summary["ImageDarkValue"],
            "Detected": summary["NumStarsDetected"],
            "Invalid": summary["NumInvalidStars"],
            "Noise": summary["AmountOfNoise"],
            "IDMode": self._state.settings.get("setIDMode", "IdMode"),
            "ID": 0 if identification is None else len(identification.matched),
        }

    def _performance(self) -> Values:
        results, latest = self._processing.results, self._processing.latest_ms
        flags, counts = self._state.flags, self._counts()
        steps = ("detection", "identification", "attitude")
        return {
            "ImageDarkValue": counts["DarkValue"],
            "NumStarsDetected": counts["Detected"],
            "InvalidStars": counts["Invalid"],
            "StarImageNoise": counts["Noise"],
            "Idmode": counts["IDMode"],
            "NumberOfStarsID": counts["ID"],
            "ImageCaptureSuccess": bool(self._state.retained.image_present),
            "DetectionSuccess": len(results.vectors) > 0,
            "IdentificationSuccess": results.identification is not None,
            "AttitudeSuccess": bool(self._state.retained.solved),
            "ProcessingTimeError": sum(latest.get(step, 0.0) for step in steps)
            > PROCESSING_LIMIT_MS,
            "MaxStarsDetected": "MaxStarsDetection" in flags,
            "LessThanThreeStarsInFoV": "LessThanThreeStarsInFoV" in flags,
            "CommsError": any(flag.startswith(("UART_", "I2C_")) for flag in flags),
        }
