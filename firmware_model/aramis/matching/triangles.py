"""A planar triangle of three star directions: area, polar moment, and their standard deviations.

AraMiS thesis, section 5.5 (equations 5.7 to 5.21), in single precision. Side a joins stars 1 and 2,
b joins 2 and 3, c joins 1 and 3; they are chords of the unit sphere, without a unit. Three printed
slips are corrected: the covariance of equation 5.13 is sigma squared times the projector, the
derivative of the area by c is (u1 + u2 + u3 - u4) / 4A, and the three derivatives of equation 5.19
are A a / 18, A b / 18 and A c / 18.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.mcu.costs import Meter

_ZERO, _HALF, _ONE, _FOUR = (np.float32(value) for value in (0, 0.5, 1, 4))
_EIGHTEEN, _THIRTY_SIX = np.float32(18), np.float32(36)


@dataclass(frozen=True, eq=False)
class Triangle:
    """A measured triangle, or several with one more axis in front."""

    sides: Floats  #: (3,) a, b, c
    area: Any  #: float32, by Heron's formula; 0 where the stars are on a line
    moment: Any  #: float32, polar moment of the area
    area_sigma: Any  #: float32, standard deviations by the directions' noise
    moment_sigma: Any


def charge_triangles(count: int, meter: Meter) -> None:
    """Charge ``count`` triangles whose stars are not on a line."""
    _charge_sides(count, meter)
    meter.charge(f32_sqrt=3 * count, f32_add=68 * count, f32_mul=75 * count, f32_div=17 * count)
    meter.charge(f32_compare=2 * count, loop=6 * count)


def measure_triangle(vectors: Floats, sigma_rad: float, meter: Meter) -> Triangle | None:
    """Measure the triangle of three unit vectors (3, 3); None when they lie on a line.

    ``sigma_rad`` is the standard deviation of each across the line of sight, per axis.
    """
    found = measure_triangles(vectors[None].astype(np.float32), np.ones((1, 3), np.float32))
    (sides,), (area,), (moment,) = found.sides, found.area, found.moment
    if not area > 0 or sides.min() <= 0:
        _charge_sides(1, meter)
        return None
    charge_triangles(1, meter)
    sigma = np.float32(sigma_rad)
    return Triangle(sides, area, moment, sigma * found.area_sigma[0], sigma * found.moment_sigma[0])


def measure_triangles(corners: Floats, sigma_rad: Floats) -> Triangle:
    """Measure triangles of unit vectors (n, 3, 3) with errors (n, 3), each axis; not charged."""
    edges = corners[:, [0, 1, 0]] - corners[:, [1, 2, 2]]
    sides = np.sqrt((edges * edges).sum(axis=2))
    a, b, c = sides.T
    half = _HALF * (a + b + c)
    sa, sb, sc = (half[:, None] - sides).T
    u1, u2, u3, u4 = sa * sb * sc, half * sb * sc, half * sa * sc, half * sa * sb
    area = np.sqrt(np.maximum(half * u1, _ZERO))
    squares = a * a + b * b + c * c
    # Derivatives by the sides, then by the directions (equations 5.14, 5.18 to 5.20).
    by_side = np.stack([u1 - u2 + u3 + u4, u1 + u2 - u3 + u4, u1 + u2 + u3 - u4], axis=1)
    by_side /= (_FOUR * np.where(area > 0, area, _ONE))[:, None]
    moment_by_side = area[:, None] * sides / _EIGHTEEN
    moment_by_side += (squares / _THIRTY_SIX)[:, None] * by_side
    lengths = np.where(sides > 0, sides, _ONE)[:, :, None]
    units = np.asarray(edges / lengths, np.float32)
    gains = (_gains(slopes, units, corners, sigma_rad) for slopes in (by_side, moment_by_side))
    return Triangle(sides, area, area * squares / _THIRTY_SIX, *gains)


def _gains(slopes: Floats, units: Floats, corners: Floats, sigma_rad: Floats) -> Floats:
    """Square roots (n,) of H R H^T: each R is a projector across its line of sight."""
    da, db, dc = (slopes[:, :, None] * units).transpose(1, 0, 2)
    moved = np.stack([da + dc, db - da, -db - dc], axis=1)
    along = (moved * corners).sum(axis=2)
    squares = (moved * moved).sum(axis=2) - along * along
    gains: Floats = np.sqrt(np.maximum((squares * sigma_rad**2).sum(axis=1), _ZERO))
    return gains


def _charge_sides(count: int, meter: Meter) -> None:
    meter.charge(f32_add=20 * count, f32_mul=19 * count, f32_sqrt=3 * count)
    meter.charge(f32_compare=count, ram_read=9 * count, call=count)
