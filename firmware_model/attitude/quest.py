"""QUEST: the attitude that best turns the catalogue's vectors into the measured ones.

CubeStar thesis, section 4.4 (equations 4.4.8 to 4.4.10) and section 5.3.5 (Gaussian elimination,
equation 5.3.1), in single precision and in the order of operations of the C program.

The thesis reads its quaternion as one that turns the axes. This is the conjugate, which turns the
vectors: v_camera = q v_inertial q*.

The Rodrigues vector grows without bound near rotations of 180 deg. The method of sequential
rotations avoids that: turning the reference axes by 180 deg about x, y or z only changes signs of
the columns of the profile matrix. The determinant of equation 4.4.9 grows with the square of the
quaternion's scalar part, so the one of the four choices with the largest determinant is solved.
(The trace would not do: in a narrow field it hardly depends on the rotation about the boresight.)
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

#: Largest eigenvalue of Davenport's matrix from the profile (3, 3) of weights that add up to 1.
Eigenvalue = Callable[[NDArray[np.float32], Meter], np.float32]

#: Smallest determinant for weights that add up to 1. Two vectors an angle apart give half its
#: square, so this is 0.1 deg; below, rounding in single precision would decide the roll angle.
_SMALLEST_DETERMINANT = np.float32(2e-6)

#: Signs of the reference axes: unchanged, or turned by 180 deg about x, y or z.
_TURNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float32)


_DIAGONAL = np.diag_indices(3)


class AttitudeError(ValueError):
    """The vectors do not determine an attitude."""


def quest(
    measured: NDArray[np.float32],
    reference: NDArray[np.float32],
    weights: NDArray[np.float32],
    meter: Meter,
    *,
    eigenvalue: Eigenvalue | None = None,
    rotated: bool = True,
) -> NDArray[np.float32]:
    """Quaternion (4,), scalar last and not negative, of the rotation reference to measured.

    Args:
        measured, reference: (n, 3) unit vectors of the same stars in camera and inertial axes.
        weights: (n,) not negative, not all zero; in the thesis votes of the verification.
        meter: charged with every operation.
        eigenvalue: finds the largest eigenvalue; None takes 1, as the thesis does.
        rotated: False solves equation 4.4.9 as printed, however near to singular it is.

    Raises:
        AttitudeError: for fewer than two vectors, weights of 0, or vectors in one direction.
    """
    if len(measured) < 2:
        raise AttitudeError(f"an attitude needs at least 2 vectors, not {len(measured)}")
    profile = _profile(measured, reference, weights, meter)
    total = np.float32(0)
    for weight in weights.astype(np.float32):
        total += weight
    if total <= 0:
        raise AttitudeError("the weights of the vectors add up to 0")
    profile /= total
    largest = np.float32(1) if eigenvalue is None else eigenvalue(profile, meter)
    turns = _TURNS if rotated else _TURNS[:1]
    choices = [_system(profile * signs, largest, meter) for signs in turns]
    meter.charge(f32_add=len(weights), f32_div=9, f32_compare=1, loop=len(weights))
    turn = _best(choices, meter) if rotated else 0
    rodrigues = _eliminate(*choices[turn], meter)
    if not np.isfinite(rodrigues).all():
        raise AttitudeError("equation 4.4.9 is singular: a rotation by 180 deg, or one direction")
    squares = np.float32(1)
    for component in rodrigues:
        squares += component * component
    scale = np.float32(1) / np.sqrt(squares)
    meter.charge(f32_mul=6, f32_add=3, f32_sqrt=1, f32_div=1)
    x, y, z, w = np.append(rodrigues * scale, scale)
    turned_back = ((x, y, z, w), (w, -z, y, -x), (z, w, -x, -y), (-y, x, w, -z))[turn]
    quaternion = np.array(turned_back, dtype=np.float32)
    quaternion[:3] = -quaternion[:3]
    meter.charge(f32_compare=1, i32_add=11)
    return -quaternion if quaternion[3] < 0 else quaternion


def dcm(quaternion: NDArray[np.float32], meter: Meter) -> NDArray[np.float32]:
    """Direction cosine matrix (3, 3), inertial to camera (equation 5.3.1 of the conjugate)."""
    x, y, z, w = quaternion.astype(np.float32)
    two = np.float32(2)
    diagonal = w * w - (x * x + y * y + z * z)
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    meter.charge(f32_mul=4 + 6 + 3 + 6, f32_add=3 + 3 + 6)
    return np.array([
        [diagonal + two * x * x, two * (xy - wz), two * (xz + wy)],
        [two * (xy + wz), diagonal + two * y * y, two * (yz - wx)],
        [two * (xz - wy), two * (yz + wx), diagonal + two * z * z],
    ], dtype=np.float32)  # fmt: skip


def _profile(
    measured: NDArray[np.float32],
    reference: NDArray[np.float32],
    weights: NDArray[np.float32],
    meter: Meter,
) -> NDArray[np.float32]:
    """B = sum of w * measured * reference^T, (3, 3), added up star by star."""
    body = weights.astype(np.float32)[:, None] * measured.astype(np.float32)
    products = body[:, :, None] * reference.astype(np.float32)[:, None, :]
    count = len(weights)
    meter.charge(f32_mul=12 * count, f32_add=9 * count, ram_read=7 * count, loop=13 * count)
    return np.asarray(products.sum(axis=0))


def _system(
    profile: NDArray[np.float32], eigenvalue: np.float32, meter: Meter
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Matrix (3, 3) and right side (3,) of equation 4.4.9, for weights that add up to 1."""
    sigma = profile[0, 0] + profile[1, 1] + profile[2, 2]
    matrix = -(profile + profile.T)
    matrix[_DIAGONAL] += eigenvalue + sigma
    right = np.array(
        [
            profile[1, 2] - profile[2, 1],
            profile[2, 0] - profile[0, 2],
            profile[0, 1] - profile[1, 0],
        ],
        dtype=np.float32,
    )
    meter.charge(f32_add=2 + 1 + 6 + 3 + 3, ram_read=9, ram_write=12)
    return matrix, right


def _best(choices: list[tuple[NDArray[np.float32], NDArray[np.float32]]], meter: Meter) -> int:
    """The system with the largest determinant."""
    determinants = [_determinant(matrix, meter) for matrix, _ in choices]
    turn = int(np.argmax(determinants))
    meter.charge(f32_compare=len(choices))
    if determinants[turn] < _SMALLEST_DETERMINANT:
        raise AttitudeError("the vectors all point the same way: no rotation about it")
    return turn


def _determinant(m: NDArray[np.float32], meter: Meter) -> np.float32:
    meter.charge(f32_mul=9, f32_add=5, ram_read=9)
    return np.float32(
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )


def _eliminate(
    matrix: NDArray[np.float32], right: NDArray[np.float32], meter: Meter
) -> NDArray[np.float32]:
    rows = np.column_stack([matrix, right]).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):  # singular: checked by the caller
        for column in range(3):
            pivot = column + int(np.argmax(np.abs(rows[column:, column])))
            rows[[column, pivot]] = rows[[pivot, column]]
            for row in range(column + 1, 3):
                factor = rows[row, column] / rows[column, column]
                rows[row, column:] -= factor * rows[column, column:]
    solution = np.zeros(3, dtype=np.float32)
    for row in (2, 1, 0):
        rest = rows[row, 3]
        for column in range(row + 1, 3):
            rest -= rows[row, column] * solution[column]
        solution[row] = rest / rows[row, row]
    meter.charge(
        f32_div=3 + 3,
        f32_mul=11 + 3,
        f32_add=11 + 3,
        f32_compare=6,
        loop=30,
        ram_read=60,
        ram_write=30,
    )
    return solution
