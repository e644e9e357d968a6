"""Assignment of the stars of a matched triangle to the measured ones.

AraMiS thesis, section 5.8 (tables 5.1 to 5.3). Two criteria add a score to a 3 x 3 matrix of
measured against catalogue stars: the order of brightness, and the order of the sides. Each scores
its coefficient of variation (standard deviation over mean of the three measured values), so the
criterion with the larger differences decides. A side represents the star opposite to it. The text
calls the numerator the variance; with that the score has a unit, and of brightness in counts it is
thousands of times that of sides in radians. `assign_plainly` follows the listing of appendix E,
which differs.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.mcu.costs import Meter

#: Corner opposite to side a (1-2), b (2-3) and c (1-3).
OPPOSITE = np.array([2, 0, 1])

_THREE, _TWO = np.float32(3), np.float32(2)


@dataclass(frozen=True, eq=False)
class Assignment:
    """Identities of three measured stars."""

    scores: Floats  #: (3, 3) measured stars down, stars of the catalogue's triangle across
    #: (3,) star of the catalogue's triangle for each measured one, by the higher score
    order: Indices
    other: Indices  #: (3,) the same by the criterion that lost; equal to `order` when both agree


def assign(
    brightness: Floats,
    sides: Floats,
    v_mag: Floats,
    catalogue: Floats,
    meter: Meter,
    *,
    by_variance: bool = False,
) -> Assignment:
    """Score the stars of a measured triangle against those of the catalogue's.

    Measured are the ``brightness`` (3,), in any linear unit, and the ``sides`` (3,) a, b, c; of the
    catalogue's stars the magnitudes (3,) and unit vectors (3, 3) are known. ``by_variance``: a
    score is the variance over the mean, and depends on that unit.
    """
    corners = catalogue.astype(np.float32)
    x, y, z = (corners[[0, 1, 0]] - corners[[1, 2, 2]]).T
    expected = x * x + y * y + z * z
    meter.charge(f32_add=15, f32_mul=9, ram_read=9)
    by_brightness = _correspond(-brightness, v_mag)
    by_sides = np.empty(3, dtype=np.intp)
    by_sides[OPPOSITE] = OPPOSITE[_correspond(sides, expected)]
    spread = dispersion if by_variance else variation
    weights = spread(brightness, meter), spread(sides, meter)
    scores = np.zeros((3, 3), dtype=np.float32)
    measured = np.arange(3)
    scores[measured, by_brightness] += weights[0]
    scores[measured, by_sides] += weights[1]
    meter.charge(f32_compare=12 + 6, f32_add=6, ram_read=18, ram_write=24, loop=9)
    if weights[0] > weights[1]:
        return Assignment(scores, by_brightness, by_sides)
    return Assignment(scores, by_sides, by_brightness)


def assign_plainly(brightness: Floats, sides: Floats, catalogue: Floats, meter: Meter) -> Indices:
    """Star (3,) of the catalogue's triangle for each measured one, as appendix E prints it.

    The listing sorts the catalogue's stars by magnitude, but drops the result, so they stay in the
    order of their numbers. Each measured star, the brightest first, scores for the one of its place
    by how far its brightness is from the others'. A side scores for the catalogue's nearest one,
    unless two have the same. Each star takes its own highest score, even if two take the same star.
    """
    order = [0, 2, 1]  # of sides: a, c, b stand opposite to stars 3, 2, 1
    corners, half = catalogue.astype(np.float32), np.float32(0.5)
    edges = corners[[0, 0, 1]] - corners[[1, 2, 2]]
    expected = _TWO * np.arcsin(half * np.sqrt((edges * edges).sum(axis=1)))
    measured = _TWO * np.arcsin(half * sides[order])
    nearest = np.abs(expected[:, None] - measured).argmin(axis=1)
    mean = brightness.sum() / _THREE
    apart = np.abs(brightness[:, None] - brightness) + np.diag(np.full(3, np.inf, np.float32))
    scores = np.diag(apart.min(axis=1) / mean)
    if len(set(nearest.tolist())) == 3:
        scores[2 - nearest, 2 - np.arange(3)] += variation(expected, meter)
    meter.charge(f32_add=15 + 2 + 9 + 6 + 3, f32_mul=9 + 12, f32_div=4, f32_sqrt=3, f32_acos=6)
    meter.charge(f32_compare=9 + 6 + 9, ram_read=18, ram_write=12, loop=18)
    # The listing keeps the last of equal scores.
    found: Indices = 2 - scores[:, ::-1].argmax(axis=1)
    return found


def variation(values: Floats, meter: Meter) -> np.float32:
    """Coefficient of variation of three values: sample standard deviation over mean."""
    variance, mean = _moments(values, meter)
    meter.charge(f32_div=1, f32_sqrt=1, f32_compare=1)
    return np.float32(np.sqrt(variance) / mean) if mean > 0 else np.float32(0)


def dispersion(values: Floats, meter: Meter) -> np.float32:
    """Sample variance of three values over their mean."""
    variance, mean = _moments(values, meter)
    meter.charge(f32_div=1, f32_compare=1)
    return np.float32(variance / mean) if mean > 0 else np.float32(0)


def _moments(values: Floats, meter: Meter) -> tuple[np.float32, np.float32]:
    """Sample variance and mean of three values."""
    x, y, z = values.astype(np.float32)
    mean = (x + y + z) / _THREE
    squares = (x - mean) ** 2 + (y - mean) ** 2 + (z - mean) ** 2
    meter.charge(f32_add=7, f32_mul=3, f32_div=2)
    return squares / _TWO, mean


def _correspond(measured: Floats, expected: Floats) -> Indices:
    """For each measured value the expected one of the same rank."""
    found = np.empty(3, dtype=np.intp)
    found[np.argsort(measured, kind="stable")] = np.argsort(expected, kind="stable")
    return found
