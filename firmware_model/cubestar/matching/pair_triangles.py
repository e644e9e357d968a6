"""Triangles of centroids that agree with triangles of catalogue stars, from the pair list.

An extension. Centroids come in an order, the brightest first. Each new one is paired with all
before it; every entry of the pair list as wide as such a pair names the new centroid with one of
its stars, and the older one with the other. Two entries that give the new centroid the same star
name two older centroids: if these two stars stand as far apart as the centroids do, and turn the
same way, there is a triangle. So each triple is tried once, all triples of bright centroids before
any with a fainter one, and a false star spoils only those that it is in. (Pyramid, Mortari et al.
2004, has the same aim with its order of triples.)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_cosine
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import LEVELS
from cubestack.firmware_model.star_tracker.search import Triangles

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]
Marks = NDArray[np.bool_]

#: Entries that the newest centroid may have with all others; beyond, its step is not done.
MOST_PAIRS = 3072

#: Centroids whose triangles the model finds together, for its own speed; later ones follow only if
#: these give no attitude. The charge is made centroid by centroid.
_BATCHES = (8, 24, 64)

#: Triangles that chance gives over those of even stars in a round field: measured in random
#: pictures. In a field twice as wide as high rings cross at smaller angles, and real stars cluster.
_UNEVEN = 2.5

_SMALLEST_SQUARED_SINE = np.float32(1e-8)


class PairTriangles:
    """Triangles among centroids, proposed by the pair list of a catalogue.

    Attributes:
        entries: entries of the pair list that were as wide as a pair of centroids, so far.
    """

    def __init__(
        self, catalogue: StarCatalogue, listed: Marks | None, meter: Meter, limit: int
    ) -> None:
        """Use the ``listed`` (stars,) stars, None for all; end at ``limit`` cycles of the meter."""
        self.catalogue, self.listed, self.meter, self.limit = catalogue, listed, meter, limit
        self.entries = 0

    def steps(
        self, directions: Floats, tolerance_rad: float, factor: float = 1.0
    ) -> Iterator[Triangles | None]:
        """Triangles of unit vectors (n, 3), the brightest first, whose sides differ by
        ``tolerance_rad`` at most; None where time or memory ends the steps.

        The meter is charged step by step, in phases `distances`, `votes` and `identities`.
        ``factor`` multiplies the tangents of field angles.
        """
        with self.meter.phase("distances"):
            rays = scaled(directions, factor, self.meter)
        sides, done = _Sides(rays), 2
        for batch in _BATCHES:
            count = min(batch, len(rays))
            if count > done:
                found = _Batch(sides, done, count, self, tolerance_rad)
                for first, last in found.groups():
                    if found.charged(first, last):
                        yield found.step(first, last, factor)
                        continue
                    for newest in range(first, last + 1):
                        if not found.charged(newest, newest):
                            yield None
                            return
                        yield found.step(newest, newest, factor)
                done = count


@lru_cache(maxsize=128)
def _pairs_of(count: int) -> tuple[Indices, Indices]:
    """Newer and older one of all pairs of so many centroids, by rising newer one."""
    return np.tril_indices(count, -1)


class _Sides:
    """What is between the centroids of unit vectors (n, 3).

    Attributes:
        cosines, sines: (n, n) of the angles between them.
        angles: (p,) in rad, of the pairs as ``_pairs_of`` has them.
    """

    def __init__(self, rays: Floats) -> None:
        self.cosines = rays @ rays.T
        square = self.cosines * self.cosines
        self.sines = np.sqrt(np.maximum(1 - square, _SMALLEST_SQUARED_SINE))
        self.angles = arc_cosine(np.minimum(self.cosines[_pairs_of(len(rays))], np.float32(1)))


@dataclass(frozen=True)
class _Work:
    """What the centroids of a batch in front of each make together; the last is in front of none.

    Attributes:
        walked: entries of the pair list that are as wide as a pair.
        entries: entries with either star as that of the newer centroid.
        wedges: every two entries that give the newer centroid one star.
        found: triangles.
    """

    walked: list[int]
    entries: list[int]
    wedges: list[int]
    found: list[int]


class _Batch:
    """All triangles among the first ``count`` centroids whose newest is not one of the first
    ``done``, and what work each centroid makes."""

    def __init__(
        self, sides: _Sides, done: int, count: int, triangles: PairTriangles, tolerance_rad: float
    ) -> None:
        self._done, self._count, self._of = done, count, triangles
        self._catalogue, self._tolerance_rad = triangles.catalogue, tolerance_rad
        self._tolerance = np.float32(tolerance_rad)
        begin, end = done * (done - 1) // 2, count * (count - 1) // 2
        newer, older = (each[begin:] for each in _pairs_of(count))
        self._angle = sides.angles[begin:end]
        ranks = np.arange(done, count + 1)
        walked = self._look_up(ranks * (ranks - 1) // 2 - begin)
        stars = len(self._catalogue)
        # An entry joins the rim, an older centroid with one star, to the hub, the newer one with
        # the other star; either may be either.
        hub = ((newer * stars).take(self._pair) + self._ends[::-1]).ravel()
        small = np.uint16 if count * stars < 1 << 16 else np.int32
        self._order = hub.astype(small).argsort(kind="stable")
        self._hub = hub.take(self._order)
        rims = older.take(self._pair)
        self._rims, self._rim_stars = np.concatenate((rims, rims)), self._ends.ravel()
        self._pair_up(sides)
        entries = self._hub.searchsorted(ranks * stars)
        wedges = self._first.searchsorted(entries)
        found = self._fits.searchsorted(wedges)
        self._before = _Work(*(each.tolist() for each in (walked, entries, wedges, found)))
        # Chance: each entry fixes an attitude in two ways; a third star then agrees where two
        # rings of width 2 e cross, 4 e^2 over the sine of the angle of crossing (2/pi in the mean).
        density = _UNEVEN * stars / (4 * pi)
        self._chance = len(hub) / (end - begin) * density * 2 * pi * tolerance_rad**2

    def _look_up(self, pairs: Indices) -> Indices:
        """Find the entries as wide as the pairs; how many the pairs in front of some walk over."""
        angles, reach = self._catalogue.pairs.angle, self._tolerance
        start, end = angles.searchsorted(np.array((self._angle - reach, self._angle + reach)))
        lengths = end - start
        pair = np.arange(len(start)).repeat(lengths)
        entry = np.arange(len(pair)) + (end - lengths.cumsum()).repeat(lengths)
        ends = self._catalogue.pairs.ends.take(entry, axis=1)
        walked = pair.searchsorted(pairs)
        if self._of.listed is not None:
            kept = self._of.listed[ends].all(axis=0)
            pair, entry, ends = pair[kept], entry[kept], ends[:, kept]
        self._pair, self._entry, self._ends = pair, entry, ends
        return walked

    def _pair_up(self, sides: _Sides) -> None:
        """Find every two entries of one hub, each with all of the hub's entries before it, and
        which of them fit."""
        place = np.arange(len(self._hub))
        before = place.copy()
        before[1:] *= self._hub[1:] != self._hub[:-1]
        before = place - np.maximum.accumulate(before)
        wedges = before.cumsum()
        first = place.repeat(before)
        second = (place + wedges - before - 1).repeat(before) - np.arange(len(first))
        one, two = self._order.take(first), self._order.take(second)
        rim, other = self._rims.take(one), self._rims.take(two)
        star, another = self._rim_stars.take(one), self._rim_stars.take(two)
        side = rim * len(sides.cosines) + other
        third = self._catalogue.cosines.take(star * len(self._catalogue) + another)
        third = np.abs(third - sides.cosines.take(side)) / sides.sines.take(side)
        fits = (third <= self._tolerance).nonzero()[0]
        apart = (rim.take(fits) != other.take(fits)) & (star.take(fits) != another.take(fits))
        self._first, self._fits = first, fits[apart]
        self._one, self._two, self._third = one, two, third

    def groups(self) -> list[tuple[int, int]]:
        """First and last of the centroids up to each that has triangles, and of what follows."""
        found, done = self._before.found, self._done
        lasts = [
            rank for rank in range(done, self._count) if found[rank - done] < found[rank + 1 - done]
        ]
        firsts = [done, *(last + 1 for last in lasts)]
        lasts.append(self._count - 1)
        return [(one, two) for one, two in zip(firsts, lasts, strict=True) if one <= two]

    def charged(self, first: int, last: int) -> bool:
        """Charge the steps of the centroids from a first to a last one, if the time suffices."""
        entries = self._before.entries[first - self._done : last + 2 - self._done]
        if max(after - before for before, after in pairwise(entries)) > MOST_PAIRS:
            return False
        return self._of.meter.charge_all(self._operations(first, last), self._of.limit)

    def _operations(self, first: int, last: int) -> dict[str, dict[str, int]]:
        """What each phase of some steps of the part's program executes."""
        work, begin, end = self._before, first - self._done, last + 1 - self._done
        walked, entries, wedges, found = (
            each[end] - each[begin] for each in (work.walked, work.entries, work.wedges, work.found)
        )
        steps = last - first + 1
        older = steps * (first + last) // 2
        searched, cleared = (
            len(self._catalogue.pairs).bit_length() * older,
            steps * (len(self._catalogue) // 2),
        )
        return {
            "distances": {  # of the newest centroid to the older ones: angles and their sines
                "f32_mul": 5 * older,
                "f32_add": 5 * older,
                "f32_acos": older,
                "f32_sqrt": older,
                "ram_read": 6 * older,
            },
            # Entries of the pair list, each kept with the newest centroid's star. Floats that are
            # not negative are in order as integers, and compared as such.
            "votes": {
                "flash_read": searched + 3 * walked,
                "i32_add": 4 * (searched + entries) + walked + older,
                "table_byte": 2 * entries,
                "ram_write": 2 * entries + cleared,
                "loop": searched + walked + entries + cleared,
            },
            "identities": {  # third sides, and which way the triangles turn
                "f32_mul": 4 * wedges + 19 * found,
                "f32_add": 3 * wedges + 10 * found,
                "flash_read": 6 * wedges + 9 * found,
                "i32_add": 6 * wedges + found,
                "table_byte": wedges,
                "ram_write": 8 * found,
                "loop": wedges,
            },
        }

    def step(self, first: int, last: int, factor: float) -> Triangles:
        """Triangles of the last of some centroids, those whose newest star has most triangles
        first, and the chance of all of them."""
        work, done = self._before, self._done
        self._of.entries += work.entries[last + 1 - done] - work.entries[first - done]
        triples = (last * (last * last - 1) - first * (first - 1) * (first - 2)) / 6
        fits = self._fits[work.found[last - done] : work.found[last + 1 - done]]
        hub = self._hub.take(self._first.take(fits))
        if len(fits) > 1:
            popularity = hub.searchsorted(hub, side="right") - hub.searchsorted(hub)
            chosen = (-popularity).argsort(kind="stable")
            fits, hub = fits.take(chosen), hub.take(chosen)
        both = np.array((self._one.take(fits), self._two.take(fits)))
        centroids, stars = np.full((2, len(fits), 3), last)
        centroids[:, :2] = self._rims.take(both).T
        stars[:, :2], stars[:, 2] = self._rim_stars.take(both).T, hub % len(self._catalogue)
        both %= max(len(self._pair), 1)
        wide = self._catalogue.pairs.angle.take(self._entry.take(both))
        one, two = np.abs(wide - self._angle.take(self._pair.take(both)))
        misfit = np.maximum(np.maximum(one, two), self._third.take(fits))
        # Entries and both rings are narrower by a level: its cube of triangles by chance.
        level = np.searchsorted(LEVELS, np.minimum(misfit.astype(float) / self._tolerance_rad, 1))
        shares = len(LEVELS) * np.array(LEVELS)[level] ** 3
        factors = np.full(len(misfit), factor)
        return Triangles(centroids, stars, shares, factors, triples * self._chance)
