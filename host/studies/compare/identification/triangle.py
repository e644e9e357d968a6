"""The triangle algorithm: three sides against a list of all triangles, and a fourth star.

CubeStar thesis, section 4.2.1.1 (side-side-side; the brightest stars first; a fourth star decides).
"""

from itertools import combinations

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import (
    FLOAT,
    INDEX,
    Catalogue,
    MeasuredAngles,
    angles,
    charge_lookup,
    index_bytes,
)
from cubestack.host.studies.compare.tracker import NONE, Image, Indices

BRIGHTEST = 8
"""Stars of which all triangles are tried (chosen)."""

FOURTH = 4
"""Further stars that may decide."""


class Triangle:
    """Triangles sorted by the longest side; the stars of each opposite to its rising sides."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.vectors, self.margin = catalogue.vectors, catalogue.tracker.margin_rad
        stars = catalogue.triangles
        first, second, third = (self.vectors[stars[:, k]] for k in range(3))
        opposite = (angles(second, third), angles(first, third), angles(first, second))
        sides = np.stack(opposite, axis=1).astype(np.float32)
        rising = np.argsort(sides, axis=1)
        sides = np.take_along_axis(sides, rising, axis=1)
        stars = np.take_along_axis(stars, rising, axis=1)
        order = np.argsort(sides[:, 2], kind="stable")
        self.stars, self.sides = stars[order], np.ascontiguousarray(sides[order].T)
        self.database_bytes = len(stars) * (3 * INDEX + 3 * FLOAT) + index_bytes(len(stars))
        self.database_bytes += catalogue.star_bytes
        self.ram_bytes = 64 * 4 * INDEX  # candidates

    def __call__(self, image: Image, meter: Meter) -> Indices:
        names = np.full(len(image.rays), NONE)
        measured = MeasuredAngles(image.rays, meter)
        bright = range(min(BRIGHTEST, len(image.rays)))
        for triple in sorted(combinations(bright, 3), key=sum):
            candidates = self._look_up(triple, measured, meter)
            rest = [star for star in bright if star not in triple]
            for fourth in rest[:FOURTH] if len(candidates) else ():
                found = self._decide(triple, candidates, fourth, measured, meter)
                if len(found) == 1:
                    names[[*triple, fourth]] = found[0]
                    return names
        return names

    def _look_up(
        self, triple: tuple[int, int, int], measured: MeasuredAngles, meter: Meter
    ) -> Indices:
        """Stars (k, 3) of the triangles that agree, in the triple's order."""
        i, j, k = triple
        opposite = np.array([measured(j, k), measured(i, k), measured(i, j)])
        rising = np.argsort(opposite)
        low, high = opposite[rising] - self.margin, opposite[rising] + self.margin
        start, stop = self.sides[2].searchsorted([low[2], high[2]])
        short, middle = self.sides[:2, start:stop]
        agree = np.flatnonzero((short >= low[0]) & (short <= high[0]))
        agree = agree[(middle[agree] >= low[1]) & (middle[agree] <= high[1])]
        charge_lookup(stop - start, meter)
        meter.charge(f32_compare=3 + 2 * (stop - start), ram_write=2 * len(agree))
        found = np.empty((len(agree), 3), np.intp)
        found[:, rising] = self.stars[start:stop][agree]
        return found

    def _decide(
        self,
        triple: tuple[int, int, int],
        candidates: Indices,
        fourth: int,
        measured: MeasuredAngles,
        meter: Meter,
    ) -> Indices:
        """Stars (k, 4) of the candidates to which a fourth star agrees in all three sides."""
        i, j, k = triple
        others = self._look_up((i, j, fourth), measured, meter)
        one, other = np.nonzero((candidates[:, None, :2] == others[None, :, :2]).all(axis=2))
        meter.charge(ram_read=2 * len(candidates) * len(others), loop=len(candidates) * len(others))
        added = others[other, 2]
        side = angles(self.vectors[candidates[one, 2]], self.vectors[added])
        agree = (np.abs(side - measured(k, fourth)) <= self.margin) & (candidates[one, 2] != added)
        meter.charge(f32_mul=4 * len(one), f32_add=3 * len(one), f32_compare=len(one))
        return np.asarray(np.column_stack([candidates[one], added])[agree])
