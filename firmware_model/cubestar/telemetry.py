"""Values of every telemetry frame, taken when it is asked for."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cubestack.firmware_model.algorithms.geometry import angles_of
from cubestack.firmware_model.algorithms.quest import dcm
from cubestack.firmware_model.costs import Meter
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.commands import Commands
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.star_reports import StarReports
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.hardware import Hardware
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar_codes import ImageBlockSize, SwitchState
from cubestack.firmware_model.interface.cubestar_flags import flag_fields
from cubestack.firmware_model.interface.message import Message

__all__ = ["Telemetry"]

NODE_TYPE = 5
FIRMWARE_VERSION = (0, 1)
SERIAL_NUMBER = 1
PROCESSING_LIMIT_MS = 500

Values = dict[str, Any]

#: Telemetry that shows a setting: (telemetry field, setting telecommand, its field).
_SETTINGS_SHOWN: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Exposure": (("exposure", "Exposure", "exposure"),),
    "FocalLengthDetails": (
        ("FocalLength", "setFocalLength", "FocalLength"),
        ("Fx", "setFocalLengthComponents", "Fx"),
        ("Fy", "setFocalLengthComponents", "Fy"),
    ),
    "PrincipalPoint": (("Cx", "setPrincipalPoint", "Cx"), ("Cy", "setPrincipalPoint", "Cy")),
    "DistortionCoef": (
        ("K1", "setRadialDistortionGains", "K1"),
        ("K2", "setRadialDistortionGains", "K2"),
        ("P1", "setTangentalDistortionGains", "P1"),
        ("P2", "setTangentalDistortionGains", "P2"),
    ),
    "DetectionRegion": tuple(
        (name, "setDetectionRegion", name)
        for name in ("StepSize", "Xstart", "Xend", "Ystart", "Yend")
    ),
    "StarPixels": tuple((name, "setStarPixels", name) for name in ("MinPixels", "MaxPixels")),
    "StarGrid": (("GridSize", "setDetectionVariables", "GridSize"),),
    "MaxStars": (
        ("maxStars", "setDetectionVariables", "MaxStars"),
        ("maxInvalidStars", "setDetectionVariables", "MaxInvalidStars"),
        ("maxNoise", "setDetectionVariables", "MaxNoise"),
    ),
    "IDMode": (("Mode", "setIDMode", "IdMode"),),
    "IDMargin": (("Margin", "setIDMargin", "Margin"),),
    "DelayTime": (("Timeout", "setDelayTimerTimeout", "Time"),),
}

#: Telemetry that shows times in ms: (field, step of Processing, longest or latest).
_TIMES_SHOWN: dict[str, tuple[tuple[str, str, bool], ...]] = {
    "DetectionTimingOne": (
        ("MaxStarSearchTime", "search", True),
        ("MaxCentroidFindTime", "centroid", True),
        ("MaxCorrectionTime", "correction", True),
        ("MaxVectorCalTime", "vectors", True),
    ),
    "DetectionTimingTwo": (
        ("StarDetectionTime", "detection", False),
        ("MaxStarDetectionTime", "detection", True),
    ),
    "IDTimingOne": (
        ("MaxModeSelectionTime", "reduction", True),
        ("MaxDistanceCalTime", "distances", True),
        ("MaxVoteRoundOneTime", "votes", True),
        ("MaxFindIDTime", "identities", True),
    ),
    "IDTimingTwo": (
        ("MaxVoteRoundTwoTime", "verification", True),
        ("MaxSelectID", "selection", True),
        ("MaxAlgoCompletionTime", "identification", True),
    ),
    "IDTimingThree": (
        ("StarIdentificationTime", "identification", False),
        ("MaxStarIdentificationTime", "identification", True),
    ),
    "BestStarSelectionTime": (("LatestTime", "best", False), ("MaxTime", "best", True)),
    "AttitudeTiming": (("LatestTime", "attitude", False), ("MaxTime", "attitude", True)),
}


class Telemetry:
    """Answers telemetry requests; interrupt context, so nothing here waits."""

    def __init__(
        self,
        hardware: Hardware,
        meter: Meter,
        state: State,
        capture: ImageCapture,
        processing: Processing,
        supply: SupplyMonitor,
        commands: Commands,
        pending: Callable[[], bool],
    ) -> None:
        """Report on the given parts; ``pending``: whether telecommands wait in the queue."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._capture = capture
        self._processing = processing
        self._supply = supply
        self._commands = commands
        self._pending = pending
        stars = StarReports(processing)
        self._sources: dict[str, Callable[[], Values]] = {
            "Identification": self._identification,
            "ExtendedIdentification": self._extended_identification,
            "ErrorFlags": state.flag_values,
            "TcmdProcessed": self._processed,
            "TaskStatus": lambda: {"taskStatus": state.task_status},
            "StartAndLoopTime": self._loop_times,
            "SRAMTestResults": lambda: {"TestResult": commands.memory_test},
            "PowerStatus": lambda: {"Status": self._switch(), **self._currents()},
            "ImageSetup": INTERFACE.telemetry("ImageSetup").reset_values,
            "IS_Register": lambda: {"DataH": 0, "DataL": capture.sensor.selected_register[1] or 0},
            "ImageBlock": self._image_block,
            "CameraTiming": self._camera_timing,
            "TimingSummary": self._timing_summary,
            "DetectionThresholdValues": self._thresholds,
            "LogStatus": self._log_status,
            "Quaternion": lambda: dict(
                zip(("Qbar0", "Qbar1", "Qbar2", "Qbar3"), self._quaternion(), strict=True)
            ),
            "SphereicalCoordinates": self._boresight_angles,
            "AttitudeData": self._attitude_data,
            "PerformanceParameters": self._performance,
            "Results": self._result_counts,
            "AttitudeQuaternion": self._attitude_quaternion,
            "PhaseTimes": self._phase_times,
            "UploadStatus": lambda: {
                "NextBlock": commands.next_block,
                "BlocksReceived": commands.blocks_received,
            },
            "SupplyReport": self._supply_report,
            "CameraRegister": self._camera_register,
            "LoopStatus": self._loop_status,
            **stars.sources,
        }

    def values(self, message: Message) -> Values | None:
        """Values of every field of ``message``; None when the node does not offer it."""
        shown = _SETTINGS_SHOWN.get(message.name)
        if shown is not None:
            return {name: self._state.settings.get(*setting) for name, *setting in shown}
        times = _TIMES_SHOWN.get(message.name)
        if times is not None:
            return {
                name: (self._processing.longest_ms if longest else self._processing.latest_ms).get(
                    step, 0.0
                )
                for name, step, longest in times
            }
        source = self._sources.get(message.name)
        return None if source is None else source()

    # --- node ---------------------------------------------------------------------------------

    def _identification(self) -> Values:
        seconds, milliseconds = divmod(self._hardware.uptime_ms(), 1000)
        return {
            "NodeType": NODE_TYPE,
            "InterfaceVersion": INTERFACE.version,
            "FirmwareVersionMajor": FIRMWARE_VERSION[0],
            "FirmwareVersionMinor": FIRMWARE_VERSION[1],
            "RuntimeMilliseconds": milliseconds,
            "RuntimeSeconds": seconds & 0xFFFF,
        }

    def _extended_identification(self) -> Values:
        retained = self._state.retained
        return {
            "SerialNumber": SERIAL_NUMBER,
            "Temperature": self._hardware.temperature_c(),
            "ResetCause": self._hardware.reset_cause,
            "WDGResetCount": retained.watchdog_resets,
            "TcmdCount": retained.telecommands & 0xFFFF,
            "TlmCount": retained.telemetry & 0xFFFF,
        }

    def _processed(self) -> Values:
        return {"Processed": int(not self._pending() and not self._commands.running)}

    def _loop_times(self) -> Values:
        retained = self._state.retained
        return {
            "StartupTime": self._state.startup_ms,
            "LoopTime": retained.loop_ms,
            "MaxLoopTime": retained.longest_loop_ms,
        }

    def _switch(self) -> SwitchState:
        return SwitchState.ON if self._supply.imager_on else SwitchState.OFF

    def _currents(self) -> Values:
        present = self._supply.sample()
        return {
            "Current": present,
            "MaxCurrent": self._supply.highest_ma,
            "MinCurrent": self._supply.lowest_ma,
        }

    def _log_status(self) -> Values:
        shown = {f.name: f.flag in self._state.flags for f in flag_fields(log_names=True)}
        return {
            "Temp": self._hardware.temperature_c(),
            "Runtime": self._hardware.uptime_ms() // 1000,
            "WDGcounter": self._state.retained.watchdog_resets,
            "Status": self._state.task_status,
            "SW": self._switch(),
            **self._currents(),
            **shown,
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

    # --- camera and picture -------------------------------------------------------------------

    def _camera_register(self) -> Values:
        address, value = self._capture.sensor.selected_register
        return {"Address": address, "Value": value or 0, "Valid": int(value is not None)}

    def _camera_timing(self) -> Values:
        retained = self._state.retained
        return {
            "SetupTime": retained.camera_setup_us / 1000,
            "ExposureUpdateTime": retained.camera_setup_us / 1000,
            "CaptureTime": (retained.discard_us + retained.capture_us) / 1000,
        }

    def _timing_summary(self) -> Values:
        retained = self._state.retained
        captured_us = retained.discard_us + retained.capture_us + retained.transfer_us
        return {
            "ImageCaptureTime": captured_us / 1000,
            "DetectionTime": retained.detect_us / 1000,
            "IdentificationTime": retained.match_us / 1000,
        }

    def _image_block(self) -> Values:
        setting = self._state.settings.all("ImageBlockSet")
        length = ImageBlockSize(setting["BlockSize"]).length
        start = setting["BlockNumber"] * length
        data = self._hardware.external_ram[start : start + length].tobytes()
        if length > ImageBlockSize.BYTES_128.length:  # 256 bytes come as two reads
            half = len(data) // 2
            data = data[half:] if self._commands.second_half else data[:half]
            self._commands.second_half = not self._commands.second_half
        self._meter.charge(ebi_read=len(data))
        return {"Block": data.ljust(ImageBlockSize.BYTES_128.length, b"\0")}

    def _phase_times(self) -> Values:
        retained = self._state.retained
        phases = {
            "Idle": retained.idle_us,
            "Discard": retained.discard_us,
            "Capture": retained.capture_us,
            "Transfer": retained.transfer_us,
            "Detect": retained.detect_us,
            "Match": retained.match_us,
            "Attitude": retained.attitude_us,
        }
        return {**phases, "LoopTotal": 1000 * retained.loop_ms}

    # --- results ------------------------------------------------------------------------------

    def _thresholds(self) -> Values:
        detection = self._processing.results.detection
        return {
            "DarkThreshold": 0 if detection is None else detection.dark_value,
            **self._state.settings.all("setDetectionThresholds"),
        }

    def _quaternion(self) -> np.ndarray[Any, Any]:
        attitude = self._state.attitude
        return np.array([0, 0, 0, 1], np.float32) if attitude is None else attitude.quaternion

    def _boresight_angles(self) -> Values:
        right_ascension, declination = angles_of(
            dcm(self._quaternion(), self._meter)[2], self._meter
        )
        return {"RightAscension": right_ascension, "Declination": declination}

    def _attitude_data(self) -> Values:
        quaternion = self._quaternion()
        boresight = dcm(quaternion, self._meter)[2]
        return {
            **dict(zip(("Qbar0", "Qbar1", "Qbar2", "Qbar3"), quaternion, strict=True)),
            **self._boresight_angles(),
            **dict(zip(("BSVX", "BSVY", "BSVZ"), boresight, strict=True)),
        }

    def _attitude_quaternion(self) -> Values:
        attitude = self._state.attitude
        return {
            **dict(zip(("Q0", "Q1", "Q2", "Q3"), self._quaternion(), strict=True)),
            "FrameCounter": 0 if attitude is None else attitude.frame,
            "ImageTime": 0 if attitude is None else attitude.image_ms,
            "Mode": self._processing.results.mode if attitude is None else attitude.mode,
            "Matched": 0 if attitude is None else attitude.matched,
            "Valid": self._processing.results.solved,
        }

    def _result_counts(self) -> Values:
        counts = self._counts()
        return {
            "DarkValue": counts["ImageDarkValue"],
            "Detected": counts["NumStarsDetected"],
            "Invalid": counts["InvalidStars"],
            "Noise": counts["StarImageNoise"],
            "IDMode": counts["Idmode"],
            "ID": counts["NumberOfStarsID"],
        }

    def _counts(self) -> Values:
        results = self._processing.results
        detection, identification = results.detection, results.identification
        return {
            "NumStarsDetected": len(results.vectors),
            "StarImageNoise": 0 if detection is None else detection.noise,
            "InvalidStars": 0 if detection is None else detection.invalid,
            "NumberOfStarsID": 0 if identification is None else len(identification.matched),
            "Idmode": self._state.settings.get("setIDMode", "IdMode"),
            "ImageDarkValue": 0 if detection is None else detection.dark_value,
        }

    def _performance(self) -> Values:
        results, latest = self._processing.results, self._processing.latest_ms
        flags = self._state.flags
        processing_ms = sum(
            latest.get(step, 0.0) for step in ("detection", "identification", "attitude")
        )
        return {
            **self._counts(),
            "ImageCaptureSuccess": bool(self._state.retained.image_present),
            "DetectionSuccess": len(results.vectors) > 0,
            "IdentificationSuccess": results.identification is not None,
            "AttitudeSuccess": results.solved,
            "ProcessingTimeError": processing_ms > PROCESSING_LIMIT_MS,
            "MaxStarsDetected": "MaxStarsDetection" in flags,
            "LessThanThreeStarsInFoV": "LessThanThreeStarsInFoV" in flags,
            "CommsError": any(flag.startswith(("UART_", "I2C_")) for flag in flags),
        }
