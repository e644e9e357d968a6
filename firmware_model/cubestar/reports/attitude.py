"""Telemetry of the attitude, and of how the latest picture was processed."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import angles_of
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.mcu.costs import Meter

PROCESSING_LIMIT_MS = 500
"""CubeStar thesis, section 5.3.6."""

Values = dict[str, Any]


class AttitudeReports:
    """Values of the telemetry of the attitude, and of the latest picture's outcome.

    Without any attitude the quaternion is that of no rotation.

    Attributes:
        sources: by name of the telemetry frame.
    """

    def __init__(self, state: State, processing: Processing, meter: Meter) -> None:
        """Report on the attitude in ``state`` and the results of ``processing``."""
        self._state = state
        self._processing = processing
        self._meter = meter
        self.sources: dict[str, Callable[[], Values]] = {
            "Quaternion": lambda: self._printed_quaternion(self._quaternion()),
            "SphereicalCoordinates": lambda: self._angles(self._boresight(self._quaternion())),
            "AttitudeData": self._attitude_data,
            "AttitudeQuaternion": self._attitude_quaternion,
            "PerformanceParameters": self._performance,
            "Results": self._result_counts,
        }

    def _quaternion(self) -> NDArray[np.float32]:
        attitude = self._state.attitude
        return np.array([0, 0, 0, 1], np.float32) if attitude is None else attitude.quaternion

    def _boresight(self, quaternion: NDArray[np.float32]) -> NDArray[np.float32]:
        axis: NDArray[np.float32] = dcm(quaternion, self._meter)[2]
        return axis

    def _printed_quaternion(self, quaternion: NDArray[np.float32]) -> Values:
        return dict(zip(("Qbar0", "Qbar1", "Qbar2", "Qbar3"), quaternion, strict=True))

    def _angles(self, boresight: NDArray[np.float32]) -> Values:
        right_ascension, declination = angles_of(boresight, self._meter)
        return {"RightAscension": right_ascension, "Declination": declination}

    def _attitude_data(self) -> Values:
        quaternion = self._quaternion()
        boresight = self._boresight(quaternion)
        return {
            **self._printed_quaternion(quaternion),
            **self._angles(boresight),
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
            "Valid": bool(self._state.retained.solved),
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
            "AttitudeSuccess": bool(self._state.retained.solved),
            "ProcessingTimeError": processing_ms > PROCESSING_LIMIT_MS,
            "MaxStarsDetected": "MaxStarsDetection" in flags,
            "LessThanThreeStarsInFoV": "LessThanThreeStarsInFoV" in flags,
            "CommsError": any(flag.startswith(("UART_", "I2C_")) for flag in flags),
        }
