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

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_cosine
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: Entries that the newest centroid may have with all others; beyond, its step is not done.
MOST_PAIRS = 3072

#: Centroids whose triangles the model finds together, for its own speed; later ones follow only if
#: these give no attitude. The charge is made centroid by centroid.
_BATCHES = (5, 12, 24, 64)

#: Triangles that chance gives over those of even stars in a round field: measured in random
#: pictures. In a field twice as wide as high rings cross at smaller angles, and real stars cluster.
_UNEVEN = 2.5

_SMALLEST_SQUARED_SINE = np.float32(1e-8)


@dataclass(frozen=True, eq=False)
class Step:
    """What more centroids bring, of which the last alone has triangles.

    Attributes:
        newest: rank of the last one.
        centroids, stars: (t, 3) triangles, by rank of centroid and index of star; the new centroid
            is the last, those whose new star has most triangles first.
        misfit: (t,) largest difference of the sides, in rad.
        mirrored: (t,) whether they turn the other way.
        entries: entries of the pair list that the new centroids have with those before them.
        by_chance: triangles that chance gives in this step to be expected.
    """

    newest: int
    centroids: Indices
    stars: Indices
    misfit: Floats
    mirrored: NDArray[np.bool_]
    entries: int
    by_chance: float


def steps(
    rays: Floats,
    catalogue: StarCatalogue,
    tolerance_rad: float,
    listed: NDArray[np.bool_] | None,
    meter: Meter,
    limit: int,
) -> Iterator[Step]:
    """Triangles of unit vectors (n, 3) in their order.

    Args:
        rays: brightest first.
        catalogue: whose pair list is used.
        tolerance_rad: largest difference of a side.
        listed: (stars,) which stars count; None is all.
        meter: charged step by step; phases `distances`, `votes`, `identities`.
        limit: total of the meter at which this ends.
    """
    done = 2
    for batch in _BATCHES:
        count = min(batch, len(rays))
        if count > done:
            found = _Batch(rays[:count], done, catalogue, tolerance_rad, listed)
            for first, last in found.groups():
                if found.charged(first, last, meter, limit):
                    yield found.step(first, last)
                    continue
                for newest in range(first, last + 1):
                    if not found.charged(newest, newest, meter, limit):
                        return
                    yield found.step(newest, newest)
            done = count


def cycles(operations: dict[str, int], meter: Meter) -> int:
    """What operations would take, in processor cycles."""
    return sum(meter.table.operations[name].cycles * n for name, n in operations.items())


@lru_cache(maxsize=128)
def _pairs_of(count: int) -> tuple[Indices, Indices]:
    """Newer and older one of all pairs of so many centroids, by rising newer one."""
    return np.tril_indices(count, -1)


class _Batch:
    """All triangles among some centroids (n, 3) whose newest is not one of the first ``done``, and
    what work each centroid makes."""

    def __init__(
        self,
        rays: Floats,
        done: int,
        catalogue: StarCatalogue,
        tolerance_rad: float,
        listed: NDArray[np.bool_] | None,
    ) -> None:
        tolerance, count, stars = np.float32(tolerance_rad), len(rays), len(catalogue)
        self._done, self._count = done, count
        newer, older = (each[done * (done - 1) // 2 :] for each in _pairs_of(count))
        cosines = rays @ rays.T
        pair, ends, misfit = self._look_up(
            cosines[newer, older], newer, catalogue, tolerance, listed
        )
        # An entry joins the rim, an older centroid with one star, to the hub, the newer one with
        # the other star; either may be either.
        hub = (newer[pair] * stars + ends).ravel()
        order = hub.astype(np.uint16 if count * stars < 1 << 16 else np.int32).argsort(
            kind="stable"
        )
        hub, rim_star = hub[order], ends[::-1].ravel()[order]
        entry = order % max(len(pair), 1)
        rim, misfit = older[pair[entry]], misfit[entry]
        newest = hub // stars
        self._entries = np.bincount(newest, minlength=count)
        # Every two entries of one hub: each with all of the hub's entries before it.
        before = np.arange(len(hub)) - hub.searchsorted(hub)
        one = np.arange(len(hub)).repeat(before)
        other = one - 1 - _counting(before)
        self._wedges = np.bincount(newest[one], minlength=count)
        a, b, ia, ib = rim_star[one], rim_star[other], rim[one], rim[other]
        side = cosines[ia, ib]
        sine = np.sqrt(np.maximum(1 - side * side, _SMALLEST_SQUARED_SINE))
        third = np.abs(catalogue.cosines[a, b] - side) / sine
        fits = ((third <= tolerance) & (ia != ib) & (a != b)).nonzero()[0]
        one, other = one[fits], other[fits]
        hub = hub[one]
        self._centroids = np.stack((ia[fits], ib[fits], newest[one]), axis=1)
        self._stars = np.stack((a[fits], b[fits], hub % stars), axis=1)
        self._misfit = np.maximum(np.maximum(misfit[one], misfit[other]), third[fits])
        volumes = np.linalg.det(
            np.stack((rays[self._centroids], catalogue.vectors[self._stars]))
        )  # of the three vectors of each
        self._mirrored = volumes[0] * volumes[1] < 0
        self._popularity = hub.searchsorted(hub, side="right") - hub.searchsorted(hub)
        self._found = np.bincount(newest[one], minlength=count)
        self._ends = self._found.cumsum()
        # Chance: each entry fixes an attitude in two ways; a third star then agrees where two
        # rings of width 2 e cross, 4 e^2 over the sine of the angle of crossing (2/pi in the mean).
        density = _UNEVEN * stars / (4 * np.pi)
        self._chance = len(order) / len(newer) * density * 2 * np.pi * tolerance_rad**2
        self._stars_listed = stars

    def _look_up(
        self,
        cosine: Floats,
        newer: Indices,
        catalogue: StarCatalogue,
        tolerance: np.float32,
        listed: NDArray[np.bool_] | None,
    ) -> tuple[Indices, Indices, Floats]:
        """Pair (e,), both stars (2, e) and misfit (e,) in rad of entries as wide as the pairs."""
        pairs = catalogue.pairs
        angle = arc_cosine(np.minimum(cosine, np.float32(1)))
        start = pairs.angle.searchsorted(angle - tolerance)
        lengths = np.maximum(pairs.angle.searchsorted(angle + tolerance, side="right") - start, 0)
        self._walked = np.bincount(newer, lengths)
        self._steps = len(pairs).bit_length()
        pair = np.arange(len(start)).repeat(lengths)
        entry = start[pair] + _counting(lengths)
        stars = np.stack((pairs.first[entry], pairs.second[entry])).astype(np.intp)
        misfit = np.abs(pairs.angle[entry] - angle[pair])
        if listed is None:
            return pair, stars, misfit
        kept = listed[stars].all(axis=0)
        return pair[kept], stars[:, kept], misfit[kept]

    def groups(self) -> list[tuple[int, int]]:
        """First and last of the centroids up to each that has triangles, and of what follows."""
        lasts = [*self._found.nonzero()[0].tolist(), self._count - 1]
        firsts = [self._done, *(last + 1 for last in lasts)]
        return [(one, two) for one, two in zip(firsts, lasts, strict=False) if one <= two]

    def charged(self, first: int, last: int, meter: Meter, limit: int) -> bool:
        """Charge the steps of the centroids from a first to a last one, if the time suffices."""
        operations = self._operations(first, last)
        spent = sum(cycles(each, meter) for each in operations.values())
        if self._entries[first : last + 1].max() > MOST_PAIRS or meter.total + spent > limit:
            return False
        for phase, each in operations.items():
            with meter.phase(phase):
                meter.charge(**each)
        return True

    def _operations(self, first: int, last: int) -> dict[str, dict[str, int]]:
        """What each phase of some steps of the part's program executes."""
        walked, entries, wedges, found = (
            int(each[first : last + 1].sum())
            for each in (self._walked, self._entries, self._wedges, self._found)
        )
        steps = last - first + 1
        older = steps * (first + last) // 2
        searched, cleared = self._steps * older, steps * (self._stars_listed // 2)
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

    def step(self, first: int, last: int) -> Step:
        """Triangles of the last of some centroids, with what all of them make."""
        end, count = int(self._ends[last]), int(self._found[last])
        begin = end - count
        chosen = begin + (-self._popularity[begin:end]).argsort(kind="stable")
        triples = (last * (last * last - 1) - first * (first - 1) * (first - 2)) / 6
        return Step(
            last,
            self._centroids[chosen],
            self._stars[chosen],
            self._misfit[chosen],
            self._mirrored[chosen],
            int(self._entries[first : last + 1].sum()),
            triples * float(self._chance),
        )


def _counting(lengths: Indices) -> Indices:
    """0, 1, ... up to each of ``lengths`` (n,), one after the other."""
    ends = lengths.cumsum()
    return np.arange(ends[-1] if len(ends) else 0) - (ends - lengths).repeat(lengths)
