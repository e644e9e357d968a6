"""Attitudes that triples of measured stars suggest, the most promising triples first.

An extension of the AraMiS thesis' sections 5.5 to 5.8. A triple is looked up as there, by area and
moment within the bounds of its own stars' errors; then the three sides must agree one by one, and
so must the sense of rotation, which tells a triangle from its mirror image. That also says which
star is which. What is left is one attitude for each triangle, and a first look whether it puts any
further star where one was measured.

Where that finds nothing, the focal length may be another: then triangles of all sizes within
`STRETCH` are taken whose sides agree but for one factor. They are many, so few triples are tried.

Triples come in the order of the Pyramid algorithm (Mortari, Samaan, Bruccoleri and Junkins 2004,
section "smart technique to scan the combinations"): a false star spoils no long run of triples. As
stars come by their brightness, false ones that are all bright are also soon left behind.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.matching.triangles import Triangles, measure_triangles
from cubestack.firmware_model.mcu.costs import Meter

BOUND_SIGMAS = 3.5
"""Of areas, moments and sides."""

CATALOGUE_RAD = 6e-5
"""Error of a side beside the measured ones: lens, catalogue, proper motion (assumed)."""

MOST_LISTED = 12_000
"""A triple whose bounds hold more moments says too little for its time."""

MOST_TRIPLES = 4000
"""Tried with the focal length that is set, before others are."""

STRETCH = 0.035
"""Largest change of the focal length."""

MOST_STRETCHED_TRIPLES = 80
"""Tried with other ones."""

MOST_STRETCHED = 120_000
"""As `MOST_LISTED`, where the focal length may be another."""

WRONG_SHARE = 0.005
"""Of the triangles within the bounds of area and moment, at most so many agree in their sides by
chance: 0.0006 to 0.004 at errors of 0.05 to 1 px (measured with mirrored stars)."""

SMALLEST_AREA = 2e-4
"""Of chords: flatter triples leave the sense of rotation and the turn open."""

CELL = 2
"""Pixels along a side of a cell of the map of measured stars."""

FIXED = 1 << 16
"""Unit of the integers that hold directions: the difference of two stars fits 16 bits."""

BATCH = 64
"""Triples worked on at once, which only saves wall time."""

#: Corner of the catalogue's triangle for each measured one; the first three keep the sense.
_ORDERS = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]])

#: Sides by their corners: a, b, c.
_FROM, _TO = np.array([0, 1, 0]), np.array([1, 2, 2])
_SIDE = np.array([[-1, 0, 2], [0, -1, 1], [2, 1, -1]])
_SIDES = _SIDE[_ORDERS[:, _FROM], _ORDERS[:, _TO]]
"""Side of the catalogue's triangle for each measured side, in each order."""

_F = np.float32


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """An attitude that some triangle suggests.

    Attributes:
        turn: (3, 3) direction cosine matrix, inertial to camera.
        measured, stars: (3,) measured stars, and those of the database.
        triples: triples tried, this one included.
        by_chance: wrong attitudes to be expected among those tried.
        scale: focal length beside the one that is set.
    """

    turn: Floats
    measured: Indices
    stars: Indices
    triples: int
    by_chance: float
    scale: float


def pyramid(count: int) -> Iterator[tuple[int, int, int]]:
    """All triples of 0 to count - 1, so that no number stays for long."""
    for near in range(1, count - 1):
        for far in range(1, count - near):
            for first in range(count - near - far):
                yield first, first + near, first + near + far


@dataclass
class TripleSearch:
    """One picture's search.

    Attributes:
        vectors: (n, 3) unit vectors of the measured stars in camera axes, the brightest first.
        points: (n, 2) their places in px.
        sigma_rad: (n,) their errors, each axis.
        reach_px: a catalogue star is where one was measured within so many pixels.
        faces: (f,) which faces count; None: all.
        triples: tried so far.
        matches: triangles of the database within the bounds so far.
        by_chance: wrong attitudes to be expected among those tried so far.
    """

    vectors: Floats
    points: Floats
    sigma_rad: Floats
    field: Field
    database: Database
    reach_px: float
    faces: Mask | None
    meter: Meter
    triples: int = 0
    matches: int = 0
    by_chance: float = 0.0

    def run(self, fewest: int) -> Iterator[Hypothesis | None]:
        """Attitudes with so many stars that agree, and None now and then: time to look at time."""
        for stretch, most in ((0.0, MOST_TRIPLES), (STRETCH, MOST_STRETCHED_TRIPLES)):
            triples = islice(pyramid(len(self.vectors)), most)
            size = 4 if stretch else BATCH
            while batch := list(islice(triples, size)):
                yield from self._batch(np.array(batch, np.intp), fewest, stretch)

    def _batch(self, batch: Indices, fewest: int, stretch: float) -> Iterator[Hypothesis | None]:
        corners, sigma = self.vectors[batch], self.sigma_rad[batch]
        measured = measure_triangles(corners, sigma)
        found, looked_at = self._listed(measured, stretch)
        listed = np.array([len(part) for part in found])
        owner = np.repeat(np.arange(len(batch)), listed)
        triangles = np.concatenate(found)
        reach = BOUND_SIGMAS * np.sqrt(sigma[:, _FROM] ** 2 + sigma[:, _TO] ** 2) + CATALOGUE_RAD
        kept, orders, scales = self._same_sides(
            measured.sides, reach, corners, owner, triangles, stretch
        )
        owner, stars = owner[kept], self.database.stars[triangles[kept]].astype(np.intp)
        stars = np.take_along_axis(stars, _ORDERS[orders], axis=1)
        shrunk = (
            corners[owner] * np.stack([1 / scales, 1 / scales, np.ones_like(scales)], 1)[:, None]
        )
        shrunk /= np.sqrt((shrunk * shrunk).sum(axis=2, keepdims=True))
        turns = _triad(shrunk.astype(_F), self.database.vectors[stars])
        agreeing, near = self._agreeing(turns, scales)
        triple = hypothesis = 0
        for index in np.flatnonzero(agreeing >= fewest).tolist():
            upto = int(owner[index]) + 1
            tried = near[hypothesis : index + 1]
            self._charge(listed[triple:upto], looked_at[triple:upto], tried, stretch)
            triple, hypothesis = upto, index + 1
            yield Hypothesis(
                turns[index],
                batch[owner[index]],
                stars[index],
                self.triples,
                self.by_chance,
                float(scales[index]),
            )
        self._charge(listed[triple:], looked_at[triple:], near[hypothesis:], stretch)
        yield None

    def _listed(
        self, measured: Triangles, stretch: float
    ) -> tuple[list[NDArray[np.uint32]], NDArray[np.int_]]:
        """Triangles within each one's bounds, and moments that were looked at (n,)."""
        database = self.database
        low, high = (1 - stretch) ** 2, (1 + stretch) ** 2
        area, moment = BOUND_SIGMAS * measured.area_sigma, BOUND_SIGMAS * measured.moment_sigma
        first = np.searchsorted(database.areas, ((measured.area - area) * low).astype(_F), "left")
        last = np.searchsorted(database.areas, ((measured.area + area) * high).astype(_F), "right")
        moments = database.moments
        start = np.searchsorted(moments, ((measured.moment - moment) * low**2).astype(_F), "left")
        stop = np.searchsorted(moments, ((measured.moment + moment) * high**2).astype(_F), "right")
        most = MOST_STRETCHED if stretch else MOST_LISTED
        used = (measured.area >= SMALLEST_AREA) & (stop - start <= most)
        looked_at = np.where(used, stop - start, 0)
        found = []
        for index, count in enumerate(looked_at.tolist()):
            part = database.moment_triangles[start[index] : start[index] + count]
            part = part[(part >= first[index]) & (part < last[index])]
            if self.faces is not None:
                part = part[self.faces[database.faces[part]]]
            found.append(part)
        return found, looked_at

    def _same_sides(
        self,
        sides: Floats,
        reach: Floats,
        corners: Floats,
        owner: Indices,
        triangles: NDArray[np.uint32],
        stretch: float,
    ) -> tuple[Indices, Indices, Floats]:
        """Which of the triangles agree in all sides, but for one factor, and in their sense.

        Also in which of the six orders, and the factors.
        """
        fixed = self.fixed[self.database.stars[triangles].astype(np.intp)]
        edges = fixed[:, _FROM] - fixed[:, _TO]
        known = np.maximum((edges * edges).sum(axis=2), 1)[:, _SIDES]  # (k, 6, 3)
        low = (np.maximum(sides - reach, 0) * FIXED)[owner, None].astype(np.float64) ** 2 / known
        high = ((sides + reach) * FIXED)[owner, None].astype(np.float64) ** 2 / known
        least = np.maximum(low.max(axis=2), (1 - stretch) ** 2)
        most = np.minimum(high.min(axis=2), (1 + stretch) ** 2)
        kept: Mask = least <= most
        sense = _sense(corners)[owner] == _sense(fixed.astype(np.float64))
        kept[:, :3] &= sense[:, None]
        kept[:, 3:] &= ~sense[:, None]
        which, orders = np.nonzero(kept)
        scales = np.sqrt((least[which, orders] + most[which, orders]) / 2).astype(_F)
        return which, orders, scales

    def _charge(
        self,
        listed: NDArray[np.int_],
        looked_at: NDArray[np.int_],
        near: NDArray[np.int_],
        stretch: float,
    ) -> None:
        """Charge and count triples (n,) and the attitudes (k,) that they suggested."""
        self.triples += len(listed)
        self.matches += int(listed.sum())
        self.by_chance += len(near) if stretch else WRONG_SHARE * int(listed.sum())
        with self.meter.phase("triangles"):
            Triangles.charge(len(listed), self.meter)
        with self.meter.phase("search"):
            count, looked, steps = len(listed), int(looked_at.sum()), int(listed.sum())
            self.meter.charge(f32_add=8 * count, f32_mul=14 * count, f32_compare=16 * count)
            self.meter.charge(ram_read=looked + 4 * count, i32_add=2 * looked, loop=looked)
            # Three sides of integers; six orders of comparisons, most of which end at the first.
            self.meter.charge(ram_read=12 * steps, i32_mul=9 * steps, i32_add=40 * steps)
        with self.meter.phase("verification"):
            for stars in near.tolist():
                self._charge_look(stars)

    @cached_property
    def fixed(self) -> NDArray[np.int64]:
        """The catalogue's directions in integers, (n, 3)."""
        return np.rint(self.database.vectors.astype(np.float64) * FIXED).astype(np.int64)

    @cached_property
    def _map(self) -> Mask:
        """Which cells of the picture are within reach of a measured star."""
        with self.meter.phase("verification"):
            cells = np.zeros((self.field.rows // CELL + 1, self.field.columns // CELL + 1), bool)
            span = int(self.reach_px // CELL) + 1
            around = np.mgrid[-span : span + 1, -span : span + 1].reshape(2, -1).T
            around = around[np.hypot(*(CELL * around).T) <= self.reach_px]
            places = np.rint(self.points[:, ::-1] / CELL).astype(np.intp)
            rows, columns = (places[:, None] + around).reshape(-1, 2).T
            limit_y, limit_x = np.array(cells.shape) - 1
            cells[np.clip(rows, 0, limit_y), np.clip(columns, 0, limit_x)] = True
            self.meter.charge(ram_write=cells.size // 32 + len(rows), i32_add=4 * len(rows))
        return cells

    def _agreeing(self, turns: Floats, scales: Floats) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Catalogue stars that attitudes (k, 3, 3) put where one was measured, and near the field.

        The three of the triangle count whatever the map says.
        """
        cells = self._map
        boresights = np.rint(turns[:, 2].astype(np.float64) * FIXED)
        along = boresights @ self.fixed.T.astype(np.float64)
        limit = (self.field.smallest_cosine - 1e-4) * float(FIXED) ** 2
        which, stars = np.nonzero(along >= limit)
        seen = np.einsum("nij,nj->ni", turns[which], self.database.vectors[stars])
        across = seen[:, :2] / np.maximum(seen[:, 2:], _F(0.1))
        across *= scales[which, None]
        x, y = (across / self.field.scale + self.field.centre).T
        columns, rows = np.rint(x / CELL).astype(np.intp), np.rint(y / CELL).astype(np.intp)
        inside = (columns >= 0) & (rows >= 0) & (columns < cells.shape[1]) & (rows < cells.shape[0])
        hits = np.zeros(len(which), bool)
        hits[inside] = cells[rows[inside], columns[inside]]
        count = len(turns)
        return np.bincount(which, hits, count).astype(int), np.bincount(which, minlength=count)

    def _charge_look(self, near: int) -> None:
        """The attitude of three stars, products with all catalogue stars, and the map."""
        count = len(self.database.numbers)
        self.meter.charge(f32_mul=18 + 4 * 9 + 27, f32_add=15 + 4 * 4 + 18, f32_div=12, f32_sqrt=4)
        self.meter.charge(ram_read=3 * count // 2, i32_mul=3 * count, i32_add=3 * count, loop=count)
        self.meter.charge(f32_mul=11 * near, f32_add=8 * near, f32_div=2 * near, ram_read=5 * near)
        self.meter.charge(f32_convert=2 * near, loop=near)


def _sense(corners: NDArray[np.floating]) -> Mask:
    """Whether triangles of directions (n, 3, 3) turn to the left."""
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = np.einsum("ni,ni->n", first, np.cross(second, third))
    return np.asarray(volume > 0)


def _triad(measured: Floats, known: Floats) -> Floats:
    """Rotations (k, 3, 3) that turn triangles of unit vectors (k, 3, 3) into measured ones."""
    turns: Floats = np.einsum("nai,naj->nij", _frame(measured), _frame(known)).astype(_F)
    return turns


def _frame(corners: Floats) -> Floats:
    """Three unit vectors (k, 3, 3) tied to triangles: to the middle, and aside of a corner."""
    middle = corners.sum(axis=1)
    middle /= np.sqrt((middle * middle).sum(axis=1, keepdims=True))
    edge = 2 * corners[:, 0] - corners[:, 1] - corners[:, 2]
    normal = np.cross(middle, edge)
    normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    axes: Floats = np.stack([middle, normal, np.cross(middle, normal)], axis=1)
    return axes
