"""Removes the fisheye's distortion with a table of radii.

CubeSense thesis, sections 5.2 (equation 5.2.3, 2.9 px per degree), 6.2 (the table) and 6.3
(equations 6.3.7 to 6.3.9).

The published table has 227 bytes, the undistorted radius less the distorted one in whole pixels.
Its printed last entry, 49, is the polynomial's value if differences are rounded up. A whole pixel
is 0.34 deg. Equation 6.3.7, and the listing with it, adds the interpolated difference to the
radius' whole pixels only, where equations 6.3.2 and 6.3.6 add it to the radius: on average the lost
half pixel compensates the rounding.

Assumed: a table of 16-bit entries in 1/100 px, added to the whole radius. Only the compiler's pages
of 256 bytes forbade it in RAM; flash has room.

An extension: `Projection.STEREOGRAPHIC`, see there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.arithmetic import HUNDREDTHS, polynomial, to_int16
from cubestack.firmware_model.interface.cubesense.codes import PIXELS_PER_DEGREE
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.firmware_model.mcu.costs import Meter

RIM_PX = 226  #: image radius at which the field of view ends (table 5.1)

TABLE_ENTRIES = RIM_PX + 1

FOCAL_PX = np.float32(np.degrees(PIXELS_PER_DEGREE))  #: undistorted pixels per radian

NEWTON_LIMIT = 20
NEWTON_END_PX = 1e-3
FINE_PER_PX = 100  #: entries per pixel of the fine table

Values = NDArray[np.float32]


class DistortionError(ValueError):
    """Coefficients without an inverse over the field of view."""


class Projection(Enum):
    """Radius that a table assigns to a field angle theta.

    In the published one the image of the Earth's limb is no circle off the boresight, so a circle
    fitted to it is biased. The stereographic projection maps every circle in the sky to a circle.
    Half of its usual scale keeps results within an int of 1/100 px.
    """

    EQUIDISTANT = "r = f theta, published"
    STEREOGRAPHIC = "r = f tan(theta / 2), an extension"


@dataclass(frozen=True, eq=False)
class RadiusTable:
    """New radius less the radius in the image, for every pixel of the latter."""

    differences: NDArray[np.int16]  #: (227,) in 1 / `per_px` px
    per_px: int  #: unit of the entries
    entry_bytes: int  #: flash per entry
    drops_fraction: bool  #: add to the radius' whole pixels only, as equation 6.3.7 is printed

    @property
    def size(self) -> int:
        """Flash for the table, in bytes."""
        return len(self.differences) * self.entry_bytes

    def correct(self, offsets: Values, meter: Meter) -> NDArray[np.int16]:
        """Correct points (n, 2), offsets from the boresight in px; the result is in 1/100 px.

        Beyond the table its last two entries are extrapolated, and the boresight does not move; the
        text leaves both open.
        """
        x, y = offsets.astype(np.float32).T
        radius = np.sqrt(x * x + y * y)
        index = np.minimum(radius.astype(np.int64), TABLE_ENTRIES - 2)
        first = self.differences[index].astype(np.float32)
        second = self.differences[index + 1].astype(np.float32)
        base = index.astype(np.float32)
        difference = first + (second - first) * (radius - base)
        if self.per_px != 1:
            difference = difference * np.float32(1 / self.per_px)
        new = (base if self.drops_fraction else radius) + difference
        over = np.where(radius == 0, np.float32(1), radius)
        count = len(offsets)
        meter.charge(
            call=count,
            f32_mul=7 * count,
            f32_add=5 * count,
            f32_div=2 * count,
            f32_sqrt=count,
            f32_compare=count,
            f32_convert=8 * count,
            table_byte=3 * self.entry_bytes * count,
        )
        if self.per_px != 1:
            meter.charge(f32_mul=count)
        moved = np.stack([new * x / over, new * y / over], axis=1) * HUNDREDTHS
        return to_int16(moved)


def byte_table(meter: Meter, coefficients: Sequence[float] = DISTORTION) -> RadiusTable:
    """The published table: whole pixels, rounded up; r_d in px is the sum of coefficients[k] r_u^k.

    Raises DistortionError if they have no inverse, or one more than 255 px away.
    """
    difference = _undistort(coefficients, meter) - np.arange(TABLE_ENTRIES, dtype=np.float32)
    return _make_table(np.maximum(np.ceil(difference), 0), 255, meter, published=True)


def fine_table(
    meter: Meter, projection: Projection, coefficients: Sequence[float] = DISTORTION
) -> RadiusTable:
    """The table in 1/100 px, rounded to nearest; arguments and errors as for `byte_table`."""
    radius = _undistort(coefficients, meter)
    if projection is Projection.STEREOGRAPHIC:
        half_angle = radius * np.float32(0.5 / FOCAL_PX)
        radius = FOCAL_PX * np.tan(np.minimum(half_angle, np.float32(np.pi / 2)))
        meter.charge(f32_tan=TABLE_ENTRIES, f32_mul=2 * TABLE_ENTRIES)
    difference = radius - np.arange(TABLE_ENTRIES, dtype=np.float32)
    return _make_table(np.rint(difference * FINE_PER_PX), 32767, meter, published=False)


def _make_table(entries: Values, largest: int, meter: Meter, *, published: bool) -> RadiusTable:
    per_px = 1 if published else FINE_PER_PX
    furthest = float(np.abs(entries).max())
    if not furthest <= largest:
        raise DistortionError(
            f"the correction must stay within {largest / per_px:g} px, not {furthest / per_px:.0f}"
        )
    meter.charge(f32_convert=2 * TABLE_ENTRIES, f32_mul=TABLE_ENTRIES, loop=TABLE_ENTRIES)
    return RadiusTable(entries.astype(np.int16), per_px, 1 if published else 2, published)


def _undistort(coefficients: Sequence[float], meter: Meter) -> Values:
    """Undistorted radius (227,) for every distorted one, by Newton's method from the latter."""
    terms = [np.float32(value) for value in coefficients]
    slopes = [np.float32(power) * value for power, value in enumerate(terms)][1:]
    target = np.arange(TABLE_ENTRIES, dtype=np.float32)
    radius = target.copy()
    active = np.ones(TABLE_ENTRIES, dtype=bool)
    for _ in range(NEWTON_LIMIT):
        at = radius[active]
        slope = polynomial(slopes, at)
        if not np.all(slope > 0):
            break
        step = (polynomial(terms, at) - target[active]) / slope
        radius[active] = at - step
        count, products = len(at), len(terms) + len(slopes) - 2
        meter.charge(
            f32_mul=products * count,
            f32_add=(products + 2) * count,
            f32_div=count,
            f32_compare=2 * count,
            loop=count,
        )
        active[active] = ~(np.abs(step) < NEWTON_END_PX)
        if not active.any():
            return np.maximum(radius, np.float32(0))
    raise DistortionError(
        f"coefficients must rise steadily over radii up to {RIM_PX} px, not be "
        f"{', '.join(f'{value:g}' for value in coefficients)}"
    )
