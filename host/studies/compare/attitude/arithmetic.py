"""Small matrices, charged operation by operation, in the precision of what they are given.

The methods compute in single precision, as the parts do; tests give them double precision.
"""

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

Matrix = NDArray[Any]

MOST_SWEEPS = 12


def product(a: Matrix, b: Matrix, meter: Meter) -> Matrix:
    """a b of shapes (n, k) and (k, m)."""
    (rows, inner), columns = a.shape, b.shape[1]
    terms = rows * inner * columns
    meter.charge(f32_mul=terms, f32_add=terms - rows * columns, ram_read=2 * terms, loop=terms)
    meter.charge(ram_write=rows * columns)
    found: Matrix = a @ b
    return found


def cross(a: Matrix, b: Matrix, meter: Meter) -> Matrix:
    meter.charge(f32_mul=6, f32_add=3)
    return np.asarray(np.cross(a, b))


def unit(a: Matrix, meter: Meter) -> Matrix:
    """A vector (3,) of length 1."""
    meter.charge(f32_mul=6, f32_add=2, f32_sqrt=1, f32_div=1)
    return np.asarray(a / np.sqrt((a * a).sum()))


def profile(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix:
    """The attitude profile matrix B (3, 3): mean of measured times listed (CubeStar thesis, below
    equation 4.4.9; AraMiS thesis, section 6.2), all weights equal."""
    count = len(measured)
    meter.charge(f32_mul=9 * count + 9, f32_add=9 * count, ram_read=6 * count, loop=9 * count)
    return np.asarray((measured.T @ listed) / measured.dtype.type(count))


def inverse(a: Matrix, meter: Meter) -> Matrix | None:
    """Inverse by Gauss-Jordan elimination with pivots; None if a pivot is lost in rounding."""
    size = len(a)
    rows = np.hstack([a, np.eye(size, dtype=a.dtype)])
    smallest = size * np.finfo(a.dtype).eps * np.abs(a).max()
    for column in range(size):
        pivot = column + int(np.abs(rows[column:, column]).argmax())
        if not abs(rows[pivot, column]) > smallest:
            return None
        rows[[column, pivot]] = rows[[pivot, column]]
        rows[column] /= rows[column, column]
        for row in range(size):
            if row != column:
                rows[row] -= rows[row, column] * rows[column]
    terms = size * size * size
    meter.charge(f32_div=2 * size * size, f32_mul=2 * terms, f32_add=2 * terms, f32_compare=terms)
    meter.charge(ram_read=4 * terms, ram_write=2 * terms, loop=2 * terms)
    return np.asarray(rows[:, size:])


def eigenvectors(a: Matrix, meter: Meter) -> tuple[Matrix, Matrix]:
    """Eigenvalues (n,) and eigenvectors, as columns (n, n), of a symmetric matrix: Jacobi's
    rotations, sweep by sweep, until they change nothing."""
    values, vectors = a.copy(), np.eye(len(a), dtype=a.dtype)
    smallest = np.finfo(a.dtype).eps * np.abs(a).max()
    for _ in range(MOST_SWEEPS):
        turned = False
        for p, q in combinations(range(len(a)), 2):
            meter.charge(f32_compare=1, ram_read=1, loop=1)
            if abs(values[p, q]) <= smallest:
                continue
            turned = True
            turn = np.eye(len(a), dtype=a.dtype)
            turn[np.ix_([p, q], [p, q])] = _rotation(
                values[q, q] - values[p, p], 2 * values[p, q], meter
            )
            values, vectors = turn.T @ values @ turn, vectors @ turn
            moved = 3 * len(a)  # elements in pairs: of two rows, two columns, two vectors
            meter.charge(f32_mul=4 * moved, f32_add=2 * moved, ram_read=4 * moved)
            meter.charge(ram_write=2 * moved, loop=moved)
        if not turned:
            break
    return np.diag(values), vectors


def orthogonal_columns(a: Matrix, meter: Meter) -> tuple[Matrix, Matrix]:
    """a V with orthogonal columns, largest first, and the rotation V: one-sided Jacobi rotations
    (Hestenes), which keep small singular values exact."""
    left, right = a.copy(), np.eye(a.shape[1], dtype=a.dtype)
    rounding = np.finfo(a.dtype).eps
    nothing = rounding**2 * (a * a).sum()
    for _ in range(MOST_SWEEPS):
        turned = False
        for p, q in combinations(range(a.shape[1]), 2):
            one, other = left[:, p], left[:, q]
            dot, first, second = one @ other, one @ one, other @ other
            meter.charge(f32_mul=11, f32_add=6, f32_sqrt=1, f32_compare=1, ram_read=6)
            if abs(dot) <= max(rounding * np.sqrt(first * second), nothing):
                continue
            turned = True
            turn = _rotation(second - first, 2 * dot, meter)
            for matrix in (left, right):
                matrix[:, [p, q]] = matrix[:, [p, q]] @ turn
            meter.charge(f32_mul=24, f32_add=12, ram_read=12, ram_write=12, loop=6)
        if not turned:
            break
    order = np.argsort(-(left * left).sum(axis=0))
    meter.charge(f32_compare=3)
    return left[:, order], right[:, order]


def _rotation(difference: Any, twice: Any, meter: Meter) -> Matrix:
    """The rotation (2, 2) that makes the element twice/2 beside a diagonal zero."""
    ratio = difference / twice
    tangent = np.copysign(1, ratio) / (abs(ratio) + np.hypot(1, ratio))
    cosine = 1 / np.hypot(1, tangent)
    meter.charge(f32_div=3, f32_sqrt=2, f32_mul=3, f32_add=3)
    sine = tangent * cosine
    return np.array([[cosine, sine], [-sine, cosine]], dtype=np.asarray(difference).dtype)
