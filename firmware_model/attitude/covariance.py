"""Covariance of an attitude's error, from unit vectors of stars.

M. D. Shuster and S. D. Oh, "Three-axis attitude determination from vector observations", Journal of
Guidance and Control 4 (1981), section "covariance analysis": a star of direction b and standard
deviation sigma in each axis across it contributes the information w (I - b b^T), w = 1 / sigma^2,
about the rotation. The inverse of the sum is the covariance of the best estimate.

The residuals of the fit correct the declared sigmas, as far as so few can. The scale of the
variance is the mean of its posterior distribution (scaled inverse chi squared; A. Gelman et al.,
"Bayesian Data Analysis", 3rd edition, section 3.2), in which the declaration counts as
`PRIOR_DEGREES` squares of residuals. The mean exceeds the most likely scale, which covers the long
tails of errors whose scale is estimated from few squares. An error common to all stars leaves no
residual and is not included.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.mcu.costs import Meter

#: Degrees of freedom by which the declared sigmas count: three stars' residuals are 3, ten's 17.
PRIOR_DEGREES = 6

#: Of the information of weights that add up to 1: two stars 0.1 deg apart, as in QUEST.
_SMALLEST_DETERMINANT = np.float32(2e-6)

_IDENTITY = np.eye(3, dtype=np.float32)


def covariance(
    directions: NDArray[np.float32],
    residuals: NDArray[np.float32],
    sigmas: NDArray[np.float32],
    meter: Meter,
    *,
    excess: float = 1.0,
    beyond: float = 1.0,
) -> NDArray[np.float32]:
    """Covariance (3, 3) in rad^2 of the small rotation, about the camera's axes, from the true
    camera axes to the axes estimated with weights of 1 / sigma^2.

    Args:
        directions: (n, 3) unit vectors of the stars in camera axes, n at least 2.
        residuals: (n,) angles in rad between these and the rotated vectors of the catalogue.
        sigmas: (n,) declared standard deviation of a direction in rad, in each axis across it.
        meter: charged with every operation.
        excess: factor of the variance that the residuals show above ``beyond`` declared variances:
            more than 1 where the cause moves neighbouring stars alike, as a lens does.
        beyond: see ``excess``.

    Raises:
        AttitudeError: for fewer than two stars, or stars that are all in one direction.
    """
    count = len(directions)
    if count < 2:
        raise AttitudeError(f"a covariance needs at least 2 stars, not {count}")
    variances = sigmas.astype(np.float32) ** 2
    weights = np.float32(1) / variances
    total = np.float32(weights.sum())
    shape = inverse(information(directions, weights / total, meter), meter) / total
    squares = np.float32((residuals.astype(np.float32) ** 2 / variances).sum())
    # The mean of the posterior, degrees - 2: see above.
    scale = (np.float32(PRIOR_DEGREES) + squares) / np.float32(PRIOR_DEGREES + 2 * count - 3 - 2)
    meter.charge(
        f32_mul=3 * count + 12, f32_add=2 * count + 4, f32_div=3 * count + 1, loop=3 * count
    )
    scale = max(scale, np.float32(excess) * (scale - np.float32(beyond)) + np.float32(beyond))
    return np.asarray(scale * shape, np.float32)


def information(
    directions: NDArray[np.float32], weights: NDArray[np.float32], meter: Meter
) -> NDArray[np.float32]:
    """Sum (3, 3) of w (I - b b^T) over the stars."""
    count = len(directions)
    meter.charge(f32_mul=9 * count, f32_add=9 * count, ram_read=4 * count, loop=count)
    b = directions.astype(np.float32)
    return np.asarray(weights.sum() * _IDENTITY - (b * weights[:, None]).T @ b, np.float32)


def inverse(matrix: NDArray[np.float32], meter: Meter) -> NDArray[np.float32]:
    """Inverse of a symmetric positive matrix (3, 3) by its cofactors."""
    first, second, third = matrix
    cofactors = np.array([cross(second, third), cross(third, first), cross(first, second)])
    determinant = np.float32(first @ cofactors[0])
    meter.charge(f32_mul=12 + 3 + 6, f32_add=6 + 2, f32_div=1, f32_compare=1, ram_read=12)
    if not determinant > _SMALLEST_DETERMINANT:
        raise AttitudeError("the stars all lie in one direction: no rotation about it")
    return np.asarray(cofactors / determinant, np.float32)
