"""A planar triangle of three star directions: area, polar moment, and how well they are known.

AraMiS thesis, section 5.5 (equations 5.7 to 5.21), in single precision. Side a joins stars 1 and 2,
b joins 2 and 3, c joins 1 and 3; they are chords of the unit sphere, so they have no unit. Three
printed slips are set right: the covariance of equation 5.13 is sigma squared times the projector,
the derivative of the area by c is (u1 + u2 + u3 - u4) / 4A, and the three derivatives of equation
5.19 are A a / 18, A b / 18 and A c / 18.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.mcu.costs import Meter

_HALF, _FOUR = np.float32(0.5), np.float32(4)
_EIGHTEEN, _THIRTY_SIX = np.float32(18), np.float32(36)


@dataclass(frozen=True, eq=False)
class Triangle:
    """A measured triangle.

    Attributes:
        sides: (3,) a, b, c.
        area: by Heron's formula.
        moment: polar moment of the area.
        area_sigma, moment_sigma: standard deviations that the directions' noise gives.
    """

    sides: Floats
    area: np.float32
    moment: np.float32
    area_sigma: np.float32
    moment_sigma: np.float32


def measure_triangle(vectors: Floats, sigma_rad: float, meter: Meter) -> Triangle | None:
    """Measure the triangle of three unit vectors (3, 3); None when they lie on a line.

    ``sigma_rad`` is the standard deviation of each across the line of sight, per axis.
    """
    corners = vectors.astype(np.float32)
    edges = corners[[0, 1, 0]] - corners[[1, 2, 2]]
    x, y, z = edges.T
    a, b, c = sides = np.sqrt(x * x + y * y + z * z)
    meter.charge(f32_add=9 + 6, f32_mul=9, f32_sqrt=3, ram_read=9, call=1)
    half = _HALF * (a + b + c)
    sa, sb, sc = half - a, half - b, half - c
    u1, u2, u3, u4 = sa * sb * sc, half * sb * sc, half * sa * sc, half * sa * sb
    square = half * u1
    meter.charge(f32_add=5, f32_mul=10, f32_compare=1)
    if not square > 0 or min(a, b, c) <= 0:
        return None
    area = np.sqrt(square)
    squares = a * a + b * b + c * c
    moment = area * squares / _THIRTY_SIX
    meter.charge(f32_sqrt=1, f32_add=2, f32_mul=4, f32_div=1)

    # Derivatives by the sides, then by the directions (equations 5.14, 5.18 to 5.20).
    by_side = np.array([u1 - u2 + u3 + u4, u1 + u2 - u3 + u4, u1 + u2 + u3 - u4]) / (_FOUR * area)
    moment_by_side = area * sides / _EIGHTEEN + squares / _THIRTY_SIX * by_side
    units = edges / sides[:, None]
    meter.charge(f32_add=9 + 3, f32_mul=3 + 6, f32_div=3 + 1 + 3 + 9)
    sigma = np.float32(sigma_rad)
    return Triangle(
        sides,
        area,
        moment,
        sigma * _gain(by_side, units, corners, meter),
        sigma * _gain(moment_by_side, units, corners, meter),
    )


def _gain(slopes: Floats, units: Floats, directions: Floats, meter: Meter) -> np.float32:
    """Square root of H R H^T for sigma 1: each R is a projector across its line of sight."""
    da, db, dc = slopes[:, None] * units
    total = np.float32(0)
    for h, direction in zip((da + dc, db - da, -db - dc), directions, strict=True):
        along = h[0] * direction[0] + h[1] * direction[1] + h[2] * direction[2]
        total += h[0] * h[0] + h[1] * h[1] + h[2] * h[2] - along * along
    meter.charge(f32_mul=9 + 21 + 1, f32_add=9 + 18, f32_compare=1, f32_sqrt=1, loop=3)
    return np.float32(np.sqrt(max(total, np.float32(0))))


@dataclass(frozen=True, eq=False)
class MeasuredTriangles:
    """Measured triangles, each with the errors of its own stars.

    Attributes:
        sides: (n, 3) a, b, c.
        area, moment: (n,) 0 where the stars stand on a line.
        area_sigma, moment_sigma: (n,) standard deviations.
    """

    sides: Floats
    area: Floats
    moment: Floats
    area_sigma: Floats
    moment_sigma: Floats

    @staticmethod
    def charge(count: int, meter: Meter) -> None:
        """Charge the measuring of so many."""
        meter.charge(f32_add=61 * count, f32_mul=66 * count, f32_div=17 * count)
        meter.charge(f32_sqrt=6 * count, f32_compare=2 * count, ram_read=12 * count, call=count)


def measure_triangles(corners: Floats, sigma_rad: Floats) -> MeasuredTriangles:
    """Measure triangles of unit vectors (n, 3, 3) with errors (n, 3), each axis; not charged."""
    edges = corners[:, [0, 1, 0]] - corners[:, [1, 2, 2]]
    squares = (edges * edges).sum(axis=2)
    sides = np.sqrt(squares)
    half = _HALF * sides.sum(axis=1)
    sa, sb, sc = (half[:, None] - sides).T
    u1, u2, u3, u4 = sa * sb * sc, half * sb * sc, half * sa * sc, half * sa * sb
    area = np.sqrt(np.maximum(half * u1, np.float32(0)))
    total = squares.sum(axis=1)
    by_side = np.stack([u1 - u2 + u3 + u4, u1 + u2 - u3 + u4, u1 + u2 + u3 - u4], axis=1)
    by_side /= _FOUR * np.maximum(area, np.float32(1e-9))[:, None]
    moment_by_side = area[:, None] * sides / _EIGHTEEN + (total / _THIRTY_SIX)[:, None] * by_side
    units = edges / np.maximum(sides, np.float32(1e-9))[:, :, None]
    area_sigma, moment_sigma = (
        _gains(slopes, units, corners, sigma_rad) for slopes in (by_side, moment_by_side)
    )
    return MeasuredTriangles(sides, area, area * total / _THIRTY_SIX, area_sigma, moment_sigma)


def _gains(slopes: Floats, units: Floats, corners: Floats, sigma_rad: Floats) -> Floats:
    """Standard deviations (n,): as `_gain`, with an error for each corner."""
    da, db, dc = (slopes[:, :, None] * units).transpose(1, 0, 2)
    moved = np.stack([da + dc, db - da, -db - dc], axis=1)
    along = (moved * corners).sum(axis=2)
    squares = (moved * moved).sum(axis=2) - along * along
    gains: Floats = np.sqrt(np.maximum((squares * sigma_rad**2).sum(axis=1), np.float32(0)))
    return gains
