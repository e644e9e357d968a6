"""Quaternions of star trackers: scalar last, unit length up to rounding."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.host.errors import BadAnswerError

LENGTH_TOLERANCE = 0.01


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
