"""Checking an attitude against the stars that had no part in it. An extension: the thesis has none.

The thesis believes every unique triangle, and many of its results are wrong (section 8.2). Here the
three sides must first agree one by one, because area and moment leave one measure of a triangle
free; so must its sense of rotation. Then every catalogue star that the attitude puts into the field
is looked for among the measured ones. The attitude is believed when chance would place so many so
seldom: hypotheses * C(n, k) * p^k, for k found of the n expected besides the triangle's, where p is
the part of the field within reach of a measured star. In a cluster, such as the Pleiades, one right
place makes others likely, so stars that are all close together confirm nothing.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.mcu.costs import Meter


@dataclass(frozen=True, eq=False)
class Confirmation:
    """Stars that agree with an attitude.

    Attributes:
        measured: (k,) measured stars that a catalogue star was found for.
        stars: (k,) those catalogue stars, indices into the database's list.
        expected: catalogue stars that the attitude puts into the field.
        chance: expected number of attitudes that chance confirms as well.
        spread_rad: root mean square distance of the measured stars from their middle.
    """

    measured: Indices
    stars: Indices
    expected: int
    chance: float
    spread_rad: float


def sides_agree(vectors: Floats, catalogue: Floats, tolerance: float, meter: Meter) -> bool:
    """Whether two triangles of unit vectors (3, 3) agree within `tolerance`.

    Compared are the sides, and the volume of the three vectors, whose sign tells a triangle from
    its mirror image: nothing else does when two sides are equal.
    """
    meter.charge(f32_add=33 + 11, f32_mul=18 + 18, f32_sqrt=6, f32_compare=4, loop=3)
    for first, second in ((0, 1), (1, 2), (0, 2)):
        measured = np.sqrt(np.sum((vectors[first] - vectors[second]) ** 2))
        expected = np.sqrt(np.sum((catalogue[first] - catalogue[second]) ** 2))
        if not abs(measured - expected) <= np.float32(tolerance):
            return False
    return bool(abs(_volume(vectors) - _volume(catalogue)) <= np.float32(tolerance))


def _volume(vectors: Floats) -> np.float32:
    """Triple product of three vectors (3, 3)."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = vectors
    return np.float32(
        ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    )


def confirm(
    quaternion: Floats,
    vectors: Floats,
    database: Database,
    field: Field,
    tolerance_rad: float,
    hypotheses: int,
    meter: Meter,
) -> Confirmation:
    """Find the catalogue stars that an attitude predicts among the measured; phase `verification`.

    Args:
        quaternion: (4,) inertial to camera, scalar last.
        vectors: (n, 3) unit vectors of all measured stars in camera axes.
        tolerance_rad: largest distance of a star from its predicted place, below 0.1 rad.
        hypotheses: attitudes tried so far, this one included.
    """
    with meter.phase("verification"):
        turn = dcm(quaternion, meter)
        seen = _in_field(database.vectors, turn, field, meter)
        predicted = turned(database.vectors[seen], turn)
        expected, compared = len(seen), len(seen) * len(vectors)
        meter.charge(ram_read=6 * expected + 3 * compared, f32_compare=compared + expected)
        meter.charge(f32_mul=3 * compared, f32_add=5 * compared, loop=compared)
        apart = vectors[None, :, :] - predicted[:, None, :]
        chord2 = apart[..., 0] ** 2 + apart[..., 1] ** 2 + apart[..., 2] ** 2
        measured, stars = _nearest(chord2, np.float32(tolerance_rad) ** 2)
        reach = np.float32(len(vectors) * np.pi * tolerance_rad**2 / field.solid_angle_sr)
        further, found = expected - 3, len(measured) - 3
        chance = np.float32(hypotheses)
        for number in range(max(found, 0)):  # of the binomial, factor by factor
            chance *= reach * np.float32(further - number) / np.float32(number + 1)
        meter.charge(f32_mul=2 + 2 * max(found, 0), f32_div=1 + max(found, 0))
        meter.charge(f32_convert=2 * max(found, 0), loop=max(found, 0))
        spread_rad = _spread(vectors[measured], meter)
        return Confirmation(measured, seen[stars], expected, float(chance), spread_rad)


def _spread(vectors: Floats, meter: Meter) -> float:
    """Root mean square distance of unit vectors (n, 3) from their mean, 0 without any."""
    count = len(vectors)
    if count == 0:
        return 0.0
    meter.charge(f32_add=8 * count, f32_mul=3 * count, f32_div=4, f32_sqrt=1, loop=2 * count)
    apart = vectors - vectors.mean(axis=0)
    return float(np.sqrt(np.sum(apart**2) / np.float32(count)))


def _nearest(chord2: Floats, limit: np.float32) -> tuple[Indices, Indices]:
    """Measured stars and rows of `chord2` (stars, measured) that are nearest to each other."""
    if chord2.size == 0:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    rows, nearest = np.arange(len(chord2)), chord2.argmin(axis=1)
    kept = (chord2.argmin(axis=0)[nearest] == rows) & (chord2[rows, nearest] <= limit)
    return nearest[kept], rows[kept]


def _in_field(stars: Floats, turn: Floats, field: Field, meter: Meter) -> Indices:
    """Stars (n, 3) that a direction cosine matrix puts into the field: those near the boresight
    first, by one product each, then by their place in the picture."""
    count = len(stars)
    x, y, z = stars.T
    along = x * turn[2, 0] + y * turn[2, 1] + z * turn[2, 2]
    near = np.flatnonzero(along >= np.float32(field.smallest_cosine))
    meter.charge(ram_read=3 * count, f32_mul=3 * count, f32_add=2 * count)
    meter.charge(f32_mul=9 * len(near), f32_add=6 * len(near), f32_compare=count, loop=count)
    return near[field.contains(turned(stars[near], turn), meter)]
