"""Between Basilisk's attitudes and ours.

Basilisk has modified Rodrigues parameters sigma_BN and Euler parameters with the scalar first, both
of the matrix [BN] from inertial to body axes (Schaub and Junkins, Analytical Mechanics of Space
Systems, section 3.3). Our quaternion of the same matrix has the scalar last and the other sign of
the vector part.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]


def matrix_from_mrp(sigma: ArrayLike) -> Matrix:
    """[BN] (3, 3) of modified Rodrigues parameters (3,)."""
    x, y, z = s = np.asarray(sigma, np.float64)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    square = float(s @ s)
    turned = 8 * cross @ cross - 4 * (1 - square) * cross
    matrix: Matrix = np.eye(3) + turned / (1 + square) ** 2
    return matrix


def euler_parameters(quaternion: ArrayLike) -> list[float]:
    """Scalar first, of the matrix of our ``quaternion`` (4,)."""
    x, y, z, w = (float(part) for part in np.asarray(quaternion))
    return [w, -x, -y, -z]
