"""Triangles of centroids that agree with triangles of catalogue stars, from the pair list.

An extension. Each centroid, the brightest first, is paired with all before it. Every entry of the
pair list as wide as such a pair assigns one of its stars to the new centroid, and the other to the
older one. Two entries that assign the same star to the new centroid also name two older ones: with
a third side as wide as theirs, and the same orientation, it is a triangle. So each triple is tried
once, all triples of bright centroids before any with a fainter one, and a false star spoils only
its own. (Pyramid, Mortari et al. 2004, orders triples for the same purpose.)
"""

from collections.abc import Iterator
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
        for newest in range(2, len(rays)):
            step = self._step(newest, angles[newest, :newest], cosines, sines, tolerance_rad)
            if step is None:
                yield None
                return
            centroids, stars, misfit, found = step
            self.entries += found
            entries, pairs = entries + found, pairs + newest
            # Entries and both rings are narrower by a level: its cube of triangles by chance.
            level = np.searchsorted(LEVELS, np.minimum(misfit.astype(float) / tolerance_rad, 1))
            shares, factors = (
                len(LEVELS) * np.array(LEVELS)[level] ** 3,
                np.full(len(level), factor),
            )
            by_chance = newest * (newest - 1) / 2 * entries / pairs * per_entry
            yield Triangles(centroids, stars, shares, factors, by_chance)

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
        operations = _operations(newest, walked, len(hub), len(one), len(fits), catalogue)
        if not self._meter.charge_all(operations, self._limit):
            return None
        hubs = hub[one[fits]]
        popularity = hubs.searchsorted(hubs, side="right") - hubs.searchsorted(hubs)
        fits = fits[(-popularity).argsort(kind="stable")]
        one, two = one[fits], two[fits]
        misfit = np.maximum(np.maximum(apart[one], apart[two]), third[fits])
        centroids = np.stack([rims[one], rims[two], np.full(len(fits), newest)], axis=1)
        return centroids, np.stack([rim_stars[one], rim_stars[two], hub[one]], 1), misfit, len(hub)


def _operations(
    older: int, walked: int, entries: int, wedges: int, found: int, catalogue: StarCatalogue
) -> dict[str, dict[str, int]]:
    """Operations of each phase of a step of the part's program: ``older`` centroids, entries of the
    pair list ``walked`` over and kept, every two of these at one star, and triangles."""
    searched, cleared = len(catalogue.pairs).bit_length() * older, len(catalogue) // 2
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
