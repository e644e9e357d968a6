"""Attitudes: quaternions, rotation matrices, pointing angles, motion and errors.

Conventions: camera axes are x right, y down, z out of the lens. A quaternion (x, y, z, w), scalar
last, transforms inertial (ICRS) vectors to camera vectors, v_camera = q v_inertial q*, so that
v_camera = A(q) v_inertial with A = (w^2 - |v|^2) I + 2 v v^T + 2 w [v]x. This is the rotation of
scipy's Rotation.from_quat; in the CubeStar thesis, equation 5.3.1, the quaternion is the conjugate.
All arrays are float64.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.firmware_model.values import Keys, number

Quaternion: TypeAlias = tuple[float, float, float, float]

ANGLES: Keys = {
    "ra_deg": number(None, "right ascension of the boresight", -360, 360, role="ra"),
    "dec_deg": number(None, "declination of the boresight", -90, 90, role="dec"),
    "roll_deg": number(
        0.0, "angle of the picture's up direction, east of north", -360, 360, role="roll"
    ),
}
"""Keys of an attitude by where the boresight points."""


def unit_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """``quaternion`` scaled to length 1, shape (4,); ValueError if that is not possible."""
    return np.array(_unit(quaternion))


# Numbers of Python: for so few, an array takes ten times as long.
def _unit(quaternion: ArrayLike) -> Quaternion:
    q = np.asarray(quaternion, np.float64)
    if q.shape != (4,):
        raise ValueError(f"a quaternion has 4 numbers (x, y, z, w), not shape {q.shape}")
    x, y, z, w = q.tolist()
    norm = math.hypot(x, y, z, w)
    if not 0 < norm < math.inf:
        raise ValueError(f"a quaternion needs a finite length above 0, not {norm}")
    return x / norm, y / norm, z / norm, w / norm


def matrix_from_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Rotation (3, 3) from the first axes to the second of a quaternion (4,), scalar last."""
    x, y, z, w = _unit(quaternion)
    even = w * w - (x * x + y * y + z * z)
    xy, xz, yz = 2 * x * y, 2 * x * z, 2 * y * z
    xw, yw, zw = 2 * x * w, 2 * y * w, 2 * z * w
    return np.array(
        [
            [even + 2 * x * x, xy - zw, xz + yw],
            [xy + zw, even + 2 * y * y, yz - xw],
            [xz - yw, yz + xw, even + 2 * z * z],
        ]
    )


def quaternion_from_matrix(matrix: ArrayLike) -> NDArray[np.float64]:
    """Unit quaternion (4,) of a rotation matrix, scalar part not negative."""
    a = np.asarray(matrix, np.float64)
    # 4 q q^T, from sums of elements of A. The row of the largest component is the scaled
    # quaternion, without cancellation.
    xy, xz, yz = a[0, 1] + a[1, 0], a[0, 2] + a[2, 0], a[1, 2] + a[2, 1]
    xw, yw, zw = a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]
    products = np.array(
        [
            [1 + a[0, 0] - a[1, 1] - a[2, 2], xy, xz, xw],
            [xy, 1 - a[0, 0] + a[1, 1] - a[2, 2], yz, yw],
            [xz, yz, 1 - a[0, 0] - a[1, 1] + a[2, 2], zw],
            [xw, yw, zw, 1 + a[0, 0] + a[1, 1] + a[2, 2]],
        ]
    )
    q = unit_quaternion(products[np.argmax(np.diag(products))])
    return -q if q[3] < 0 else q


def matrix_from_pointing(ra_deg: float, dec_deg: float, roll_deg: float) -> NDArray[np.float64]:
    """Rotation matrix of a boresight and a roll: the angle of image up, east of north.

    East is to the left of north, as in the sky.
    """
    ra, dec, roll = np.radians([ra_deg, dec_deg, roll_deg])
    boresight = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    north = np.array([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)])
    east = np.array([-np.sin(ra), np.cos(ra), 0])
    up = np.cos(roll) * north + np.sin(roll) * east
    down = -up
    return np.array([np.cross(down, boresight), down, boresight])


def quaternion_from_pointing(ra_deg: float, dec_deg: float, roll_deg: float) -> NDArray[np.float64]:
    return quaternion_from_matrix(matrix_from_pointing(ra_deg, dec_deg, roll_deg))


def pointing_from_matrix(matrix: ArrayLike) -> tuple[float, float, float]:
    """Right ascension (0..360), declination and roll (-180..180) in degrees.

    At a pole of the sky, only their combination is defined; right ascension is then arbitrary, and
    roll is consistent with it.
    """
    a = np.asarray(matrix, np.float64)
    ra = np.arctan2(a[2, 1], a[2, 0])
    dec = np.arctan2(a[2, 2], np.hypot(a[2, 0], a[2, 1]))
    up = -a[1]
    north = np.array([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)])
    east = np.array([-np.sin(ra), np.cos(ra), 0])
    roll = np.arctan2(up @ east, up @ north)
    return float(np.degrees(ra) % 360), float(np.degrees(dec)), float(np.degrees(roll))


def propagate(quaternion: ArrayLike, rate_deg_s: ArrayLike, seconds: float) -> NDArray[np.float64]:
    """The attitude after ``seconds`` of a constant body rate (3,) in deg/s, camera axes.

    The camera turns by the right-hand rule about the rate vector.
    """
    a, b, c = (math.radians(rate) * seconds for rate in np.asarray(rate_deg_s, float).tolist())
    size = math.hypot(a, b, c)
    # Minus: the stars turn the opposite way.
    share = -math.sin(size / 2) / size if size else -0.5
    a, b, c, d = share * a, share * b, share * c, math.cos(size / 2)
    x, y, z, w = _unit(quaternion)
    turned = _unit(
        [
            d * x + w * a + b * z - c * y,
            d * y + w * b + c * x - a * z,
            d * z + w * c + a * y - b * x,
            d * w - a * x - b * y - c * z,
        ]
    )
    return np.array(turned if turned[3] >= 0 else [-one for one in turned])


def attitude_error_deg(q_measured: ArrayLike, q_truth: ArrayLike) -> tuple[float, float]:
    """Cross error (the angle between the boresights) and signed roll error in degrees.

    With D = A_measured A_truth^T, roll is atan2(D01 - D10, D00 + D11).
    """
    measured, truth = matrix_from_quaternion(q_measured), matrix_from_quaternion(q_truth)
    d = measured @ truth.T
    # For small angles, the cross product is more accurate than the cosine.
    cross = np.arctan2(np.linalg.norm(np.cross(measured[2], truth[2])), d[2, 2])
    roll = np.arctan2(d[0, 1] - d[1, 0], d[0, 0] + d[1, 1])
    return float(np.degrees(cross)), float(np.degrees(roll))


def random_quaternion(generator: np.random.Generator) -> NDArray[np.float64]:
    """A uniformly random attitude (4,), scalar part not negative."""
    q = unit_quaternion(generator.standard_normal(4))
    return -q if q[3] < 0 else q


# Alpha and beta are undistorted image coordinates in degrees, x (right) and y (down), as sun and
# nadir sensors report them: their root sum of squares is the angle from the boresight.


def vector_from_angles(alpha_deg: ArrayLike, beta_deg: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (..., 3) in camera axes of directions (alpha, beta)."""
    theta, phi = np.radians(np.hypot(alpha_deg, beta_deg)), np.arctan2(beta_deg, alpha_deg)
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def angles_from_vector(vector: ArrayLike) -> tuple[float, float]:
    """Alpha and beta of a direction (3,) in camera axes, of any length."""
    x, y, z = np.asarray(vector, np.float64)
    theta, phi = np.degrees(np.arctan2(np.hypot(x, y), z)), np.arctan2(y, x)
    return float(theta * np.cos(phi)), float(theta * np.sin(phi))
