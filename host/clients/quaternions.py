"""Attitudes of star trackers: their quaternions, and how the devices rate them.

Quaternions are scalar last, of unit length up to rounding.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.attitude_quality import UNKNOWN_RAD, read_covariance
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.host.errors import BadAnswerError

LENGTH_TOLERANCE = 0.01

ARCSEC_PER_DEG = 3600


def unit_quaternion(values: Mapping[str, Value], prefix: str = "Q") -> NDArray[np.float64]:
    """The quaternion (4,) in the fields ``prefix`` 0 to 3, scaled to length 1.

    Raises BadAnswerError if its length differs from 1 by more than 0.01.
    """
    quaternion = np.array([float(values[f"{prefix}{index}"]) for index in range(4)])
    norm = float(np.linalg.norm(quaternion))
    if not abs(norm - 1.0) < LENGTH_TOLERANCE:
        raise BadAnswerError(f"the node's quaternion has length {norm:.4g}, not 1")
    return quaternion / norm


def pointing_deg(quaternion: NDArray[np.float64]) -> tuple[float, float, float]:
    """Right ascension (0 to 360) and declination of the boresight, and roll (-180 to 180).

    All in degrees, of an attitude (4,) inertial to camera. Roll is the angle of the image's up
    direction, east of north; at a pole it goes with the right ascension.
    """
    x, y, z, w = quaternion
    boresight = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z
    down = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
    ra, dec = math.atan2(boresight[1], boresight[0]), math.asin(max(-1, min(1, boresight[2])))
    east = -math.sin(ra), math.cos(ra)
    up_east = -(east[0] * down[0] + east[1] * down[1])
    up_north = math.sin(dec) * (east[1] * down[0] - east[0] * down[1]) - math.cos(dec) * down[2]
    roll = math.atan2(up_east, up_north)
    return math.degrees(ra) % 360.0, math.degrees(dec), math.degrees(roll)


def attitude_columns(quaternion: NDArray[np.float64] | None) -> dict[str, float | None]:
    """Columns of a log: quaternion and pointing; None without an attitude."""
    names = ("q0", "q1", "q2", "q3", "ra_deg", "dec_deg", "roll_deg")
    if quaternion is None:
        return dict.fromkeys(names)
    return dict(zip(names, (*map(float, quaternion), *pointing_deg(quaternion)), strict=True))


@dataclass(frozen=True, kw_only=True)
class AttitudeQuality:
    """Inputs of an attitude filter, or why there are none."""

    valid: bool  #: the latest image gave an attitude, which this rates
    reason: IntEnum  #: why the attitude is missing, or that it was measured
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


def described(detected: int, identified: int, quality: AttitudeQuality) -> str:
    """Stars and attitude of an image in a sentence; without a rating, no accuracy."""
    across = max(quality.sigmas_rad[:2])
    known = across < UNKNOWN_RAD
    arcsec = float(f"{math.degrees(across) * ARCSEC_PER_DEG:.2g}")
    accuracy = f"known to {arcsec:g} arcsec" if known else "measured"
    return f"{identified} of {detected} stars identified, attitude {accuracy}"


def words(code: IntEnum) -> str:
    """The name of a code as words."""
    return code.name.lower().replace("_", " ")


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
