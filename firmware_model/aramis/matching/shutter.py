"""Correction of star directions to the time at which the middle row was exposed. An extension.

The rows of a frame are exposed one after the other. When the camera turns, each star is measured at
its own row's time, so the attitude of all of them is not that of one instant. A turn moves a star
at `u` of the frame's height from the middle row by (a + u b) x v, with `a` the error of the
attitude and `b` the turn from the first row to the last; least squares over the identified stars
yield both. Streaks that fall apart or join have wrong centroids, and the outer ones influence `b`
most, so stars that fit badly weigh 1 / (1 + (distance / twice the median)^2).
"""

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.mcu.costs import Meter

FEWEST = 5  #: stars: ten components across the line of sight for six unknowns
ROUNDS = 4  #: fits, each with the weights that the one before leaves

#: Of a moving star's place. Over the largest turn that the streaks allow, it says how much the
#: stars must show before a turn is believed.
NOISE_RAD = np.float32(2e-4)

#: Typical distance of a star from the boresight: a turn about it moves stars by so much less.
FIELD_RAD = np.float32(0.1)

_FLOOR = np.float32(1e-4)  #: rad; stars are not expected to fit better

_ONE = np.float32(1)


def at_middle_row(
    vectors: Floats, predicted: Floats, heights: Floats, moved_rad: float, meter: Meter
) -> tuple[Floats, Floats, float]:
    """Unit vectors (n, 3) as the middle row's exposure would have measured them, to first order;
    weights (n,) of 0 to 1; and the standard deviation in rad of the turn about the boresight.

    Args:
        vectors: (n, 3) measured unit vectors in camera axes, n at least `FEWEST`.
        predicted: (n, 3) where the attitude puts those stars.
        heights: (n,) rows from the middle row, in heights of the picture, -0.5 to 0.5.
        moved_rad: motion of the stars from the first row's exposure to the last's, above 0.
    """
    count = len(vectors)
    design = _design(predicted, heights)
    apart = vectors - predicted
    weights = _weights(apart)
    across = (NOISE_RAD / np.float32(moved_rad)) ** 2
    stiffness = np.diag(np.array([0, 0, 0, across, across, across * FIELD_RAD**2], np.float32))
    for _ in range(ROUNDS):
        weighted = design * weights[:, None, None]
        normal = np.einsum("nij,nik->jk", weighted, design) + stiffness
        moved = np.einsum("nij,ni->j", weighted, apart)
        found = np.linalg.solve(normal, moved).astype(np.float32)
        weights = _weights(apart - design @ found)
        # Upper triangle and right side, Cholesky, what is left over, weights.
        products = 3 * count * (6 + 21 + 6 + 6) + 6 * 6 * 6 // 6 + 2 * 6 * 6 + 5 * count
        meter.charge(f32_mul=products, f32_add=products, loop=products)
        meter.charge(f32_div=6 + 2 * count, f32_sqrt=6 + count, f32_compare=count * 4)
    turns = heights[:, None] * found[3:]
    meter.charge(f32_mul=9 * count, f32_add=6 * count, loop=count)
    straight: Floats = vectors - cross(turns, vectors)
    left = apart - design @ found
    spare = np.maximum(2 * weights.sum() - np.float32(3), _ONE)  # its stiffness holds the turn
    variance = np.maximum(weights @ np.sum(left * left, axis=1) / spare, _FLOOR**2)
    sigma = np.sqrt(variance * np.linalg.inv(normal)[2, 2])
    meter.charge(f32_mul=4 * count + 42, f32_add=4 * count + 42, f32_div=7, f32_sqrt=1)
    return straight, weights, float(sigma)


def _design(predicted: Floats, heights: Floats) -> Floats:
    """How vectors (n, 3) follow `a` and `b`: the matrix (n, 3, 6) of (a + u b) x v."""
    cross = np.zeros((len(predicted), 3, 3), dtype=np.float32)
    x, y, z = predicted.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = z, -y, x
    cross -= cross.transpose(0, 2, 1)
    return np.concatenate([cross, heights[:, None, None] * cross], axis=2)


def _weights(apart: Floats) -> Floats:
    """(n,) weights of stars that are left (n, 3) apart from where they should be."""
    distances = np.sqrt(np.sum(apart * apart, axis=1))
    typical = 2 * np.maximum(np.median(distances), _FLOOR)
    weights: Floats = _ONE / (_ONE + (distances / typical) ** 2)
    return weights
