"""A star tracker's rating of its latest attitude, common to all star trackers."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.attitude_quality import read_covariance
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.host.errors import BadAnswerError


@dataclass(frozen=True, kw_only=True)
class AttitudeQuality:
    """Inputs of an attitude filter, or why there are none."""

    valid: bool  #: the latest image gave an attitude, which this rates
    reason: IntEnum  #: why there is none, or that there is one
    #: float64 (3, 3), rad^2, of the rotation from true to reported camera axes, about the camera's
    #: x, y and z
    covariance: NDArray[np.float64]
    false_alarm: float  #: expected number of wrong attitudes that chance would confirm
    #: matched, expected: stars used, and stars expected in the image
    matched: int
    expected: int
    residual_rad: float  #: root mean square of the stars' residuals in each axis
    scale: float  #: measured focal length over the configured one
    #: background_dn, noise_dn: the sky's brightness, and the standard deviation of a pixel
    background_dn: float
    noise_dn: float
    spikes: int  #: number of bright pixels that are not stars (hot pixels, particles)

    @property
    def sigmas_rad(self) -> NDArray[np.float64]:
        """Standard deviations (3,) about the camera's x, y and z."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def common(values: Mapping[str, Value]) -> dict[str, Any]:
    """Attributes of ``AttitudeQuality`` except the reason, from a telemetry frame.

    Raises BadAnswerError for sigmas below 0 and correlations beyond 1.
    """
    try:
        covariance = np.array(read_covariance(values))
    except ValueError as error:
        raise BadAnswerError(f"telemetry Quality: {error}") from None
    return {
        "valid": bool(values["Valid"]),
        "covariance": covariance,
        "false_alarm": 10.0 ** float(values["LogFalseAlarm"]),
        "matched": int(values["Matched"]),
        "expected": int(values["Expected"]),
        "residual_rad": float(values["Residual"]),
        "scale": float(values["Scale"]),
        "background_dn": float(values["Background"]),
        "noise_dn": float(values["Noise"]),
        "spikes": int(values["Spikes"]),
    }
