"""The pyramid algorithm: a triangle from the list of pairs, and a fourth star that confirms it.

Mortari, Samaan, Bruccoleri and Junkins 2004; named in the CubeStar thesis, section 4.2.2. Triples
are taken in an order that changes all three stars often, so a false star spoils few in a row. A
unique triangle needs a fourth star with all three sides; the others are then compared with these.
"""

from collections.abc import Iterator

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import Catalogue, MeasuredAngles, angles
from cubestack.host.studies.compare.identification.agreement import agreeing
from cubestack.host.studies.compare.tracker import NONE, Image, Indices

Triple = tuple[int, int, int]

MOST_TRIPLES = 300
"""Triples of an image that are tried (chosen: of 20 stars a quarter)."""


def order(count: int) -> Iterator[Triple]:
    """Triples i, i + a, i + a + b for rising a + b, then i: the paper's loops."""
    for reach in range(2, count):
        for first in range(1, reach):
            for one in range(count - reach):
                yield one, one + first, one + reach


class Pyramid:
    """Joins the lists of two sides by the star that they share."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.vectors, self.pairs = catalogue.vectors, catalogue.pairs
        self.margin, self.used = catalogue.tracker.margin_rad, catalogue.tracker.used
        self.database_bytes = catalogue.pairs.bytes + catalogue.star_bytes
        self.ram_bytes = 2 * len(self.vectors) * 2 + 256  # chains of partners, candidates

    def __call__(self, image: Image, meter: Meter) -> Indices:
        measured = MeasuredAngles(image.rays, meter)
        count = min(self.used, len(image.rays))
        names = np.full(len(image.rays), NONE)
        for _, triple in zip(range(MOST_TRIPLES), order(count), strict=False):
            found = self._triangles(triple, image, measured, meter)
            if len(found) != 1:
                continue
            names[list(triple)] = found[0]
            rest = [star for star in range(count) if star not in triple]
            for star in rest:
                names[star] = self._agrees(star, triple, found[0], measured, meter)
                if names[star] != NONE:
                    self._name_others(names, triple, star, rest, measured, meter)
                    return agreeing(names, measured.all, self.vectors, self.margin, meter)
            names[:] = NONE
        return names

    def _triangles(
        self, triple: Triple, image: Image, measured: MeasuredAngles, meter: Meter
    ) -> Indices:
        """Stars (k, 3) of triangles that agree in sides and orientation."""
        i, j, k = triple
        first, second = (self._both(measured(i, other), meter) for other in (j, k))
        # Entries of both lists with the same star at i; each list is chained by that star.
        by_star = np.argsort(second[0], kind="stable")
        start = second[0][by_star].searchsorted(first[0])
        stop = second[0][by_star].searchsorted(first[0], side="right")
        lengths = stop - start
        one = np.repeat(np.arange(len(start)), lengths)
        skipped = np.cumsum(lengths) - lengths
        other = by_star[np.arange(len(one)) - skipped[one] + start[one]]
        stars = np.stack([first[0][one], first[1][one], second[1][other]], axis=1)
        entries = len(first[0]) + len(second[0])
        meter.charge(table_byte=2 * entries, ram_write=entries, i32_add=2 * entries)
        far = np.abs(angles(self.vectors[stars[:, 1]], self.vectors[stars[:, 2]]) - measured(j, k))
        stars = stars[(far <= self.margin) & (stars[:, 1] != stars[:, 2])]
        meter.charge(f32_mul=3 * len(one), f32_add=2 * len(one), f32_compare=2 * len(one))
        meter.charge(flash_read=6 * len(one), loop=len(one))
        here = np.linalg.det(image.rays[list(triple)].astype(np.float64))
        there = np.linalg.det(self.vectors[stars])
        meter.charge(f32_mul=9 * (1 + len(stars)), f32_add=5 * (1 + len(stars)))
        return np.asarray(stars[np.sign(there) == np.sign(here)])

    def _both(self, angle: float, meter: Meter) -> tuple[Indices, Indices]:
        """Pairs of an angle, each in both directions."""
        first, second = self.pairs.within(angle, self.margin, meter)
        return np.append(first, second), np.append(second, first)

    def _agrees(
        self, star: int, known: Triple, names: Indices, measured: MeasuredAngles, meter: Meter
    ) -> int:
        """The listed star at the measured angles to three named ones, ``NONE`` unless it is one."""
        ends, partners = self._both(measured(known[0], star), meter)
        possible = partners[ends == names[0]]
        meter.charge(ram_read=len(ends), loop=len(ends))
        for at in (1, 2):
            apart = angles(self.vectors[possible], self.vectors[names[at]])
            fits = np.abs(apart - measured(known[at], star)) <= self.margin
            meter.charge(f32_mul=3 * len(possible), f32_add=3 * len(possible))
            meter.charge(f32_compare=len(possible), flash_read=3 * len(possible))
            possible = possible[fits]
        return int(possible[0]) if len(possible) == 1 else NONE

    def _name_others(
        self,
        names: Indices,
        triple: Triple,
        fourth: int,
        rest: list[int],
        measured: MeasuredAngles,
        meter: Meter,
    ) -> None:
        for star in rest:
            if star > fourth:
                known = names[list(triple)]
                names[star] = self._agrees(star, triple, known, measured, meter)
