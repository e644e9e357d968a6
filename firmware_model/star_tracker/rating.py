"""How good an attitude is: its error, and how often chance would confirm it as well."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.robust_fit import AttitudeFit
from cubestack.firmware_model.interface.codec.attitude_quality import (
    covariance_fields,
    log_false_alarm,
)
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.mcu.costs import Meter


@dataclass(frozen=True, eq=False)
class Rating:
    """The rating of an attitude."""

    #: (3, 3) of the rotation's error about the camera's axes, rad^2
    covariance: NDArray[np.float32]
    residual_rad: float  #: root mean square of the stars' residuals in each axis
    false_alarm: float  #: expected wrong attitudes that are confirmed as well; nan if unknown
    scale: float  #: measured focal length over the one that is set

    @classmethod
    def of(cls, fit: AttitudeFit, false_alarm: float, meter: Meter) -> "Rating":
        count = len(fit.residuals)
        residual_rad = float(np.sqrt(np.mean(fit.residuals**2) / 2))
        meter.charge(f32_mul=count, f32_add=count, f32_sqrt=1)
        return cls(fit.covariance, residual_rad, false_alarm, fit.scale)

    @property
    def sigma_rad(self) -> NDArray[np.float32]:
        """(3,) standard deviations about the camera's axes."""
        return np.sqrt(np.diagonal(self.covariance)).astype(np.float32)

    def values(self, matched: int, expected: int, *, valid: bool = True) -> dict[str, Value]:
        """Fields of telemetry Quality; without the error of an attitude that is not ``valid``."""
        known = not math.isnan(self.false_alarm)
        values: dict[str, Value] = {
            "Matched": matched,
            "Expected": expected,
            "LogFalseAlarm": log_false_alarm(self.false_alarm) if known else 0.0,
            "Residual": self.residual_rad,
            "Scale": self.scale,
            "Valid": int(valid),
        }
        return values | (covariance_fields(self.covariance.tolist()) if valid else {})
