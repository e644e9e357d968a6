"""What telemetry Quality tells about the latest picture."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.results import Results
from cubestack.firmware_model.cubestar.state import UNRATED
from cubestack.firmware_model.interface.codec.attitude_quality import (
    covariance_fields,
    log_false_alarm,
)
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar.codes import Reason


@dataclass(frozen=True, eq=False)
class Rating:
    """What is known of an attitude's error.

    Attributes:
        covariance: (3, 3) of the rotation's error about the camera's axes, rad^2.
        residual: root mean square of the stars' residuals in each axis, rad.
        scale: measured focal length over the one that is set.
    """

    covariance: NDArray[np.float32]
    residual: float
    scale: float


def told(results: Results, reason: Reason) -> dict[str, Value]:
    """Values of a picture that gave no attitude for ``reason``."""
    values = UNRATED | {"FrameCounter": results.frame, "Reason": reason}
    picture = None if results.detection is None else results.detection.statistics
    if picture is not None:
        values |= {
            "Background": picture.background,
            "BackgroundRange": picture.background_range,
            "Noise": picture.noise,
            "Saturated": picture.saturated,
            "Spikes": picture.spikes,
            "Elongated": picture.elongated,
        }
    return values


def rated(
    results: Results, identification: Identification, rating: Rating, reason: Reason
) -> dict[str, Value]:
    """Values of a picture that gave an attitude; it is valid if ``reason`` says SOLVED."""
    false_alarm = identification.false_alarm
    known = not math.isnan(false_alarm)
    values = told(results, reason) | {
        "Matched": len(identification.matched),
        "Expected": identification.expected,
        "LogFalseAlarm": log_false_alarm(false_alarm) if known else 0.0,
        "Residual": rating.residual,
        "Scale": rating.scale,
        "Valid": reason is Reason.SOLVED,
    }
    if reason is Reason.SOLVED:
        values |= covariance_fields(rating.covariance.tolist())
    return values
