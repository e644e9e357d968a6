"""Triangles of centroids that agree with triangles of catalogue stars, from the pair list.

An extension. Each centroid, the brightest first, is paired with all before it. Every entry of the
pair list as wide as such a pair assigns one of its stars to the new centroid, and the other to the
older one. Two entries that assign the same star to the new centroid also name two older ones: with
a third side as wide as theirs, and the same orientation, it is a triangle. So each triple is tried
once, all triples of bright centroids before any with a fainter one, and a false star spoils only
its own. (Pyramid, Mortari et al. 2004, orders triples for the same purpose.)
"""

from collections.abc import Iterator
from functools import lru_cache
from math import pi

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_cosine
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import FLOAT, INT, POINTER, Loop, address
from cubestack.firmware_model.star_tracker.observation import LEVELS
from cubestack.firmware_model.star_tracker.search import Triangles

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]
Marks = NDArray[np.bool_]

#: Entries that the newest centroid may have with all others; beyond, its step is not done.
MOST_PAIRS = 3072

#: Triangles that chance gives over those of even stars in a round field: measured in random
#: pictures. In a field twice as wide as high rings cross at smaller angles, and real stars cluster.
_UNEVEN = 2.5

_STEP = Loop("pair_triangles_step", POINTER, INT, FLOAT, POINTER, POINTER, INT, POINTER, POINTER)
_ROOM = 64  #: triangles of a step for which there is room at first

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
        self._catalogue, self._listed, self._meter, self._limit = catalogue, listed, meter, limit
        self.entries = 0

    def steps(
        self, directions: Floats, tolerance_rad: float, factor: float = 1.0
    ) -> Iterator[Triangles | None]:
        """Triangles of unit vectors (n, 3), the brightest first, whose sides differ by
        ``tolerance_rad`` at most; None where time or memory ends the steps.

        The meter is charged step by step, in phases `distances`, `votes` and `identities`.
        ``factor`` multiplies the tangents of field angles.
        """
        with self._meter.phase("distances"):
            rays = scaled(directions, factor, self._meter)
        cosines = rays @ rays.T
        sines = np.sqrt(np.maximum(1 - cosines * cosines, _SMALLEST_SQUARED_SINE))
        angles = arc_cosine(np.minimum(cosines, np.float32(1)))
        # Chance: each entry fixes an attitude in two ways; a third star then agrees where two
        # rings of width 2 e cross, 4 e^2 over the sine of the angle of crossing (2/pi in the mean).
        density = _UNEVEN * len(self._catalogue) / (4 * pi)
        per_entry = density * 2 * pi * tolerance_rad**2
        entries = pairs = 0
        compiled = self._compiled_pass(angles, cosines, sines) if _STEP and len(rays) else None
        for newest in range(2, len(rays)):
            if compiled is not None:
                step = compiled.step(newest, tolerance_rad)
            else:
                step = self._step(newest, angles[newest, :newest], cosines, sines, tolerance_rad)
            if step is None:
                yield None
                return
            centroids, stars, misfit, found = step
            self.entries += found
            entries, pairs = entries + found, pairs + newest
            shares = factors = _NO_REALS
            if len(misfit):
                # Entries and both rings are narrower by a level: its cube of triangles by chance.
                level = np.searchsorted(LEVELS, np.minimum(misfit.astype(float) / tolerance_rad, 1))
                shares = len(LEVELS) * np.array(LEVELS)[level] ** 3
                factors = np.full(len(level), factor)
            by_chance = newest * (newest - 1) / 2 * entries / pairs * per_entry
            yield Triangles(centroids, stars, shares, factors, by_chance)

    def _compiled_pass(self, angles: Floats, cosines: Floats, sines: Floats) -> "_CompiledPass":
        return _CompiledPass(
            self._catalogue, self._listed, self._meter, self._limit, (angles, cosines, sines)
        )

    def _step(
        self, newest: int, angles: Floats, cosines: Floats, sines: Floats, tolerance_rad: float
    ) -> tuple[Indices, Indices, Floats, int] | None:
        """Triangles of the newest centroid, those first whose new star has most of them: centroids
        and stars (t, 3), largest difference of the sides (t,) in rad, and number of entries of the
        pair list; None where these are too many or time is over."""
        catalogue, tolerance = self._catalogue, np.float32(tolerance_rad)
        pairs, count = catalogue.pairs, len(catalogue)
        start, end = pairs.angle.searchsorted(np.array((angles - tolerance, angles + tolerance)))
        lengths = end - start
        older = np.arange(newest).repeat(lengths)
        entry = np.arange(len(older)) + (end - lengths.cumsum()).repeat(lengths)
        walked, ends = len(older), pairs.ends.take(entry, axis=1)
        if self._listed is not None:
            kept = self._listed[ends].all(axis=0)
            older, entry, ends = older[kept], entry[kept], ends[:, kept]
        if ends.size > MOST_PAIRS:
            return None
        # An entry joins the rim, an older centroid with one star, to the hub, the newest one with
        # the other star; either may be either.
        hub = ends[::-1].ravel()
        order = hub.astype(np.uint16).argsort(kind="stable")
        hub, rim_stars = hub.take(order), ends.ravel().take(order)
        order %= max(len(entry), 1)
        rims = older.take(order)
        apart = np.abs(pairs.angle.take(entry.take(order)) - angles.take(rims))
        # Every two entries of one hub: each with all of the hub's entries before it.
        place = np.arange(len(hub))
        before = place - hub.searchsorted(hub)
        one = place.repeat(before)
        two = (place + before.cumsum() - before - 1).repeat(before) - np.arange(len(one))
        rim, other, star, another = rims[one], rims[two], rim_stars[one], rim_stars[two]
        third = catalogue.cosines.take(star * count + another)
        third = np.abs(third - cosines[rim, other]) / sines[rim, other]
        fits = ((third <= tolerance) & (rim != other) & (star != another)).nonzero()[0]
        operations = _operations(
            newest, walked, len(hub), len(one), len(fits), sizes=_sizes(catalogue)
        )
        if not self._meter.charge_all(operations, self._limit):
            return None
        hubs = hub[one[fits]]
        popularity = hubs.searchsorted(hubs, side="right") - hubs.searchsorted(hubs)
        fits = fits[(-popularity).argsort(kind="stable")]
        one, two = one[fits], two[fits]
        misfit = np.maximum(np.maximum(apart[one], apart[two]), third[fits])
        centroids = np.stack([rims[one], rims[two], np.full(len(fits), newest)], axis=1)
        return centroids, np.stack([rim_stars[one], rim_stars[two], hub[one]], 1), misfit, len(hub)


_NO_REALS = np.zeros(0)
_NO_STEP = np.zeros((0, 3), np.intp), np.zeros((0, 3), np.intp), np.zeros(0, np.float32)


class _CompiledPass:
    """The steps of a pass in C++, with the same results and charges."""

    def __init__(
        self,
        catalogue: StarCatalogue,
        listed: Marks | None,
        meter: Meter,
        limit: int,
        between: tuple[Floats, Floats, Floats],
    ) -> None:
        """``between``: angles of the centroids (n, n), their cosines and sines."""
        self._meter, self._limit = meter, limit
        cycles = tuple(meter.table.cycles.items())
        self._phases, self._names, charges = _charges(_sizes(catalogue), cycles)
        self._arrays = catalogue, between, listed, charges  # kept for their addresses
        places = (
            *_addresses(catalogue),
            *(address(one) for one in between),
            *(0 if listed is None else address(listed), address(charges)),
        )
        sizes = len(catalogue.pairs), len(catalogue), len(between[0]), MOST_PAIRS, len(charges)
        self._pass = np.array(places + sizes, np.int64)
        self._charged = np.empty(len(charges) + 1, np.int64)  # and the number of entries
        at = address(self._charged)
        self._at = address(self._pass), at, at + 8 * len(charges)
        self._make_room(_ROOM)

    def _make_room(self, count: int) -> None:
        self._triangles = np.empty((count, 6), np.int64)
        self._misfits = np.empty(count, np.float32)
        self._room = address(self._triangles), address(self._misfits), count

    def step(
        self, newest: int, tolerance_rad: float
    ) -> tuple[Indices, Indices, Floats, int] | None:
        of_pass, charged, entries = self._at
        found = _STEP(of_pass, newest, tolerance_rad, *self._room, charged, entries)
        if found > self._room[2]:
            self._make_room(found)
            return self.step(newest, tolerance_rad)
        if found < 0:
            return None
        (*charged_now, size), count = self._charged.tolist(), len(self._phases)
        cycles = dict(zip(self._phases, charged_now[:count], strict=True))
        counts = dict(zip(self._names, charged_now[count:], strict=True))
        if not self._meter.charge_sums(cycles, counts, self._limit):
            return None
        if not found:
            return *_NO_STEP, size
        triangles = self._triangles[:found].copy()
        return triangles[:, :3], triangles[:, 3:], self._misfits[:found].copy(), size


@lru_cache(maxsize=8)
def _addresses(catalogue: StarCatalogue) -> tuple[int, int, int]:
    """Of what a step reads of a catalogue, which keeps these arrays."""
    return address(catalogue.pairs.angle), address(catalogue.pairs.ends), address(catalogue.cosines)


@lru_cache(maxsize=8)
def _charges(
    sizes: tuple[int, int], cycles: tuple[tuple[str, int], ...]
) -> tuple[tuple[str, ...], tuple[str, ...], Indices]:
    """Phases and operations of a step, and the cycles of each phase and the number of each
    operation as sums (rows, 6) of 1 and what ``_operations`` depends on."""
    units = [[int(row == column) for column in range(5)] for row in range(-1, 5)]
    each = [_operations(*unit, sizes=sizes) for unit in units]
    table = dict(cycles)
    rows: dict[str, list[int]] = {}
    for phase in each[0]:
        rows[phase] = [
            sum(table[name] * count for name, count in one[phase].items()) for one in each
        ]
    phases = tuple(rows)
    names = tuple(dict.fromkeys(name for part in each[0].values() for name in part))
    for name in names:
        rows[name] = [sum(part.get(name, 0) for part in one.values()) for one in each]
    sums = np.array(list(rows.values()), np.intp)
    sums[:, 1:] -= sums[:, :1]
    return phases, names, sums


def _sizes(catalogue: StarCatalogue) -> tuple[int, int]:
    """Steps of a search in the pair list, and words of a table of stars."""
    return len(catalogue.pairs).bit_length(), len(catalogue) // 2


def _operations(
    older: int, walked: int, entries: int, wedges: int, found: int, *, sizes: tuple[int, int]
) -> dict[str, dict[str, int]]:
    """Operations of each phase of a step of the part's program: ``older`` centroids, entries of the
    pair list ``walked`` over and kept, every two of these at one star, and triangles."""
    searched, cleared = sizes[0] * older, sizes[1]
    return {
        "distances": {  # of the newest centroid to the older ones: angles and their sines
            **{"f32_mul": 5 * older, "f32_add": 5 * older, "f32_acos": older, "f32_sqrt": older},
            "ram_read": 6 * older,
        },
        # Entries of the pair list, each kept with the newest centroid's star. Floats that are not
        # negative are in order as integers, and compared as such.
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
