"""Quick check whether distortion coefficients have an inverse, for a telecommand's acknowledge.

Computing the tables takes the part some 0.4 to 0.5 s. They are impossible if the distorted radius
does not rise steadily with the undistorted one, or an entry cannot hold a correction; results are
invalid if an int of 1/100 px cannot hold an undistorted radius. So Newton's method is applied only
at every 32nd radius, and the slope, which is cubic, is checked in between where it can be smallest:
at the ends and where its derivative, a quadratic, is zero. A correction between two tested radii is
bounded by theirs, because the radii rise.
"""

from collections.abc import Sequence

import numpy as np

from cubestack.firmware_model.cubesense.vision.arithmetic import polynomial
from cubestack.firmware_model.cubesense.vision.distortion import FOCAL_PX, NEWTON_END_PX, RIM_PX
from cubestack.firmware_model.mcu.costs import Meter

STEP_PX = 32  #: distance of the tested radii
CORRECTION_LIMIT_PX = 254  #: the published table's bytes, which are rounded up, hold 255

#: At the rim; a few pixels beyond it a radius must still fit an int of 1/100 px, which would wrap.
LARGEST_RADIUS_PX = 320

LEAST_SLOPE = np.float32(0.1)
LARGEST_RATIO = np.float32(3)
LARGEST_OFFSET_PX = np.float32(16)
NEWTON_LIMIT = 8
"""Stricter than for the tables, because radii in between are not tested: assumed."""

_TRIED = [np.float32(radius) for radius in (*range(0, RIM_PX, STEP_PX), RIM_PX)]


def invertible(coefficients: Sequence[float], meter: Meter) -> bool:
    """Whether `byte_table` and `fine_table` accept ``coefficients``, for any projection.

    Some that they accept are rejected: a slope below 0.1 somewhere, slopes that differ by more than
    a factor of 3 (the shipped lens: 2.2), an offset beyond 16 px, or a rim beyond 320 px (the
    shipped lens: 275).
    """
    with np.errstate(over="ignore", invalid="ignore"):
        terms = [np.float32(value) for value in coefficients]
        meter.charge(f32_compare=1)
        if not abs(terms[0]) <= LARGEST_OFFSET_PX:
            return False
        slopes = [np.float32(power) * value for power, value in enumerate(terms)][1:]
        found = [_undistorted(terms, slopes, radius, meter) for radius in _TRIED]
        new = [radius for radius in found if radius is not None]
        if len(new) < len(found):
            return False
        low, high = min(new[0], np.float32(0)), max(new[-1], np.float32(RIM_PX))
        return _rises(slopes, low, high, meter) and _fits(new, meter)


def _undistorted(
    terms: list[np.float32], slopes: list[np.float32], target: np.float32, meter: Meter
) -> np.float32 | None:
    """The radius that is distorted to ``target``, or None."""
    radius = target
    for _ in range(NEWTON_LIMIT):
        slope = _polynomial(slopes, radius, meter)
        meter.charge(f32_compare=2, f32_add=2, f32_div=1, loop=1)
        if not slope > LEAST_SLOPE:
            return None
        step = (_polynomial(terms, radius, meter) - target) / slope
        radius = radius - step
        if abs(step) < NEWTON_END_PX:
            return radius
    return None


def _rises(slopes: list[np.float32], low: np.float32, high: np.float32, meter: Meter) -> bool:
    """Whether the slope is steep and even enough from ``low`` to ``high``."""
    linear, square, cube = slopes[1], 2 * slopes[2], 3 * slopes[3]  # of the slope's derivative
    least = [low, high]
    # The roots of cube x^2 + square x + linear, without cancellation of similar numbers.
    root = square * square - 4 * cube * linear
    meter.charge(f32_mul=6, f32_add=3, f32_sqrt=1, f32_div=2, f32_compare=6)
    if root >= 0:
        half = np.float32(-0.5) * (square + np.copysign(np.sqrt(root), square))
        least += [half / cube] if cube != 0 else []
        least += [linear / half] if half != 0 else []
    found = [_polynomial(slopes, at, meter) for at in least if low <= at <= high]
    meter.charge(f32_compare=2 * len(found), f32_mul=1)
    return bool(min(found) > LEAST_SLOPE and max(found) <= LARGEST_RATIO * min(found))


def _fits(new: list[np.float32], meter: Meter) -> bool:
    """Whether the tables hold all corrections, and an int all radii, in either projection."""
    for radius, below in zip(new[1:], _TRIED, strict=False):
        half_angle = radius / (2 * FOCAL_PX)
        meter.charge(f32_div=1, f32_tan=1, f32_mul=1, f32_add=2, f32_compare=4, loop=1)
        if not half_angle < np.float32(np.pi / 2):
            return False
        largest = max(radius, FOCAL_PX * np.tan(half_angle))
        if not (largest <= LARGEST_RADIUS_PX and largest - below <= CORRECTION_LIMIT_PX):
            return False
    return True


def _polynomial(terms: list[np.float32], at: np.float32, meter: Meter) -> np.float32:
    meter.charge(f32_mul=len(terms) - 1, f32_add=len(terms) - 1)
    return np.float32(polynomial(terms, at))
