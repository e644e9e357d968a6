"""The rating of an attitude, and what disturbs a picture that has none.

A disturbance is reported where it explains that no stars were identified: light where it hides
stars, so that few are found or a large part of the field is blind; streaks and spikes where their
number or length is beyond what the search bears. Otherwise the search's own outcome is reported.
"""

import math
from dataclasses import dataclass
from enum import Enum

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


class Disturbance(Enum):
    """Disturbances, named as the sensors' reasons."""

    SATURATED = "parts of the field are too bright for stars"
    STRAY_LIGHT = "the sky is bright, or uneven"
    SMEAR = "motion drew the stars out"
    RADIATION = "too many pixels are hit by particles, or hot"


@dataclass(frozen=True)
class SkyStatistics:
    """What the search for stars measured of the sky."""

    background: float  #: level of the sky in DN
    background_range: float  #: difference between its bright and its dark parts in DN
    noise: float  #: median standard deviation of a pixel in DN
    saturated: float  #: share of the field that is too bright for stars, 0 to 1
    spikes: int  #: bright pixels and spots that no star leaves: hot pixels, particles


@dataclass(frozen=True)
class DisturbanceLimits:
    """Largest values that do not explain a failure: ``saturated`` to ``background_range`` of a
    picture with fewer than ``enough`` stars, ``blind`` and ``spikes`` of any."""

    saturated: float
    background: float
    background_range: float
    enough: int
    blind: float
    spikes: int

    def exceeded(
        self,
        sky: SkyStatistics,
        stars: int,
        *,
        large: bool = False,
        smear: bool = False,
        tracks: bool = False,
    ) -> Disturbance | None:
        """The gravest disturbance that explains a failure with ``stars`` found, None if none does.
        ``large``: an area that no star fills; ``smear``: streaks in one direction; ``tracks``: in
        many."""
        few = stars < self.enough
        stray_light = (
            sky.background > self.background or sky.background_range > self.background_range
        )
        is_full = large or sky.saturated > self.saturated
        found = {
            Disturbance.SATURATED: sky.saturated > self.blind or (few and is_full),
            Disturbance.STRAY_LIGHT: few and stray_light,
            Disturbance.SMEAR: smear,
            Disturbance.RADIATION: tracks or sky.spikes > self.spikes,
        }
        return next((disturbance for disturbance, present in found.items() if present), None)
