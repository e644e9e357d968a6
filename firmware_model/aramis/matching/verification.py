"""Whether a triangle near a rough direction is the right one. An extension: the thesis checks none.

The three sides must agree one by one, because area and moment leave one measure of a triangle free;
so must its sense of rotation.
"""

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.mcu.costs import Meter


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
