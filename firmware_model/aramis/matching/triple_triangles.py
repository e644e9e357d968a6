"""Triangles of measured stars that agree with those of the database, promising triples first.

An extension of the AraMiS thesis' sections 5.5 to 5.8. A triple is looked up as there, by area and
moment within the bounds of its own stars' errors; then the three sides must agree one by one, and
so must the sense of rotation, which distinguishes a triangle from its mirror image. That also
identifies the stars. Each triangle left gives one attitude, and a first look whether it puts any
further star where one was measured.

Where that finds nothing, the focal length may be another: then triangles of all sizes within
`STRETCH` are taken whose sides agree but for one factor. They are many, so few triples are tried.

Triples come in the order of the Pyramid algorithm (Mortari, Samaan, Bruccoleri and Junkins 2004,
section "smart technique to scan the combinations"): a false star spoils no long run of triples. As
stars come by their brightness, false ones that are all bright are also soon left behind.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.ranges import triangles_within
from cubestack.firmware_model.aramis.matching.triangles import (
    Triangle,
    charge_triangles,
    measure_triangles,
)
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.star_tracker.observation import Observation
from cubestack.firmware_model.star_tracker.search import SearchPass, Triangles

BOUND_SIGMAS = 3.5  #: of areas, moments and sides

#: Error of a side beside the measured ones: lens, catalogue, proper motion (assumed).
CATALOGUE_RAD = 6e-5

MOST_LISTED = 12_000  #: a triple whose bounds hold more moments says too little for its time
MOST_TRIPLES = 4000  #: tried with the focal length that is set, before others are
STRETCH = 0.035  #: largest change of the focal length
MOST_STRETCHED_TRIPLES = 80  #: tried with other ones
MOST_STRETCHED = 120_000  #: as `MOST_LISTED`, where the focal length may be another

#: Of the triangles within the bounds of area and moment, the largest share that agrees in the sides
#: by chance: 0.0006 to 0.004 at errors of 0.05 to 1 px (measured with mirrored stars).
WRONG_SHARE = 0.005

SMALLEST_AREA = 2e-4  #: of chords: flatter triples leave the sense of rotation and the turn open
CELL = 2  #: pixels along a side of a cell of the map of measured stars

#: Unit of the integers that hold directions: the difference of two stars fits 16 bits.
FIXED = 1 << 16

BATCH = 64  #: triples worked on at once, which only saves wall time

#: Corner of the catalogue's triangle for each measured one; the first three keep the sense.
_ORDERS = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]])

#: Sides by their corners: a, b, c.
_FROM, _TO = np.array([0, 1, 0]), np.array([1, 2, 2])
_SIDE = np.array([[-1, 0, 2], [0, -1, 1], [2, 1, -1]])
#: Side of the catalogue's triangle for each measured side, in each order.
_SIDES = _SIDE[_ORDERS[:, _FROM], _ORDERS[:, _TO]]

_F = np.float32


def pyramid(count: int) -> Iterator[tuple[int, int, int]]:
    """All triples of 0 to count - 1, so that no number stays for long."""
    for near in range(1, count - 1):
        for far in range(1, count - near):
            for first in range(count - near - far):
                yield first, first + near, first + near + far


class TripleTriangles:
    """Triangles among the measured stars of one picture, proposed by a triangle database.

    ``picture`` holds the stars, the brightest first; ``points`` (n, 2) are their places in px and
    ``sigma_rad`` (n,) their errors in each axis.

    Attributes:
        triples: tried so far.
        matches: triangles of the database within the bounds so far.
    """

    def __init__(
        self,
        picture: Observation,
        points: Floats,
        sigma_rad: Floats,
        field: CameraField,
        database: Database,
    ) -> None:
        self._picture, self._points, self._sigma_rad = picture, points, sigma_rad
        self._field, self._database = field, database
        self._hint: tuple[Floats, np.float32, Mask] | None = None
        self.triples = self.matches = 0

    def aim(self, hint: Floats, tolerance_deg: float) -> None:
        """Only take attitudes whose boresight is near a unit vector (3,): phase `faces`."""
        with self._picture.meter.phase("faces"):
            faces = self._database.sphere.around(hint, self._picture.meter)
        self._hint = hint.astype(_F), _F(np.cos(np.radians(tolerance_deg))), faces

    def passes(self, fewest: int) -> Iterator[SearchPass]:
        """Triangles whose attitude puts at least ``fewest`` stars where some were measured: of the
        set focal length first, then of others."""
        for stretch, most in ((0.0, MOST_TRIPLES), (STRETCH, MOST_STRETCHED_TRIPLES)):
            yield SearchPass(self._picture, self._steps(fewest, stretch, most))

    def _steps(self, fewest: int, stretch: float, most: int) -> Iterator[Triangles]:
        triples = islice(pyramid(len(self._points)), most)
        while batch := list(islice(triples, 4 if stretch else BATCH)):
            yield from self._batch(np.array(batch, np.intp), fewest, stretch)

    def _batch(self, batch: Indices, fewest: int, stretch: float) -> Iterator[Triangles]:
        corners, sigma = self._picture.directions[batch], self._sigma_rad[batch]
        measured = measure_triangles(corners, sigma)
        triangles, listed, looked_at = self._listed(measured, stretch)
        owner = np.repeat(np.arange(len(batch)), listed)
        reach = BOUND_SIGMAS * np.hypot(sigma[:, _FROM], sigma[:, _TO]) + CATALOGUE_RAD
        kept, orders, scales = self._same_sides(
            (measured.sides - reach)[owner],
            (measured.sides + reach)[owner],
            corners[owner],
            triangles,
            stretch,
        )
        owner, stars = owner[kept], self._database.stars[triangles[kept]].astype(np.intp)
        stars = np.take_along_axis(stars, _ORDERS[orders], axis=1)
        shrunk = (
            corners[owner] * np.stack([1 / scales, 1 / scales, np.ones_like(scales)], 1)[:, None]
        )
        shrunk /= np.sqrt((shrunk * shrunk).sum(axis=2, keepdims=True))
        turns = _triad(shrunk.astype(_F), self._database.vectors[stars])
        agreeing, near = self._agreeing(turns, scales)
        triple = hypothesis = 0
        for index in np.flatnonzero(agreeing >= fewest).tolist():
            upto = int(owner[index]) + 1
            tried = near[hypothesis : index + 1]
            chance = self._charge(listed[triple:upto], looked_at[triple:upto], tried, stretch)
            triple, hypothesis = upto, index + 1
            row = slice(index, index + self._is_near_hint(turns[index]))
            yield Triangles(batch[owner[row]], stars[row], np.ones(1), 1 / scales[row], chance)
        chance = self._charge(listed[triple:], looked_at[triple:], near[hypothesis:], stretch)
        yield Triangles(batch[:0], batch[:0], np.ones(0), np.ones(0), chance)

    def _is_near_hint(self, turn: Floats) -> bool:
        if self._hint is None:
            return True
        hint, least, _ = self._hint
        self._picture.meter.charge(f32_mul=3, f32_add=2, f32_compare=1)
        return bool(np.dot(turn[2], hint) >= least)

    def _listed(
        self, measured: Triangle, stretch: float
    ) -> tuple[NDArray[np.uint32], Indices, NDArray[np.int_]]:
        """Triangles within each one's bounds, their numbers (n,), and moments looked at (n,)."""
        database = self._database

        def bounds(of: Floats, middle: Any, sigma: Any, power: int) -> tuple[Indices, Indices]:
            low, high = (1 - stretch) ** power, (1 + stretch) ** power
            start = of.searchsorted(((middle - BOUND_SIGMAS * sigma) * low).astype(_F), "left")
            stop = of.searchsorted(((middle + BOUND_SIGMAS * sigma) * high).astype(_F), "right")
            return start, stop

        first, last = bounds(database.areas, measured.area, measured.area_sigma, 2)
        start, stop = bounds(database.moments, measured.moment, measured.moment_sigma, 4)
        most = MOST_STRETCHED if stretch else MOST_LISTED
        used = (measured.area >= SMALLEST_AREA) & (stop - start <= most)
        looked_at = np.where(used, stop - start, 0)
        faces = None if self._hint is None else self._hint[2]
        ranges = start, looked_at
        return *triangles_within(database, ranges, (first, last), faces), looked_at

    def _same_sides(
        self,
        shortest: NDArray[np.floating],
        longest: NDArray[np.floating],
        corners: Floats,
        triangles: NDArray[np.uint32],
        stretch: float,
    ) -> tuple[Indices, Indices, Floats]:
        """Which of the triangles (k,) agree in all sides, but for one factor, and in their sense;
        in which of the six orders, and the factors."""
        fixed = self._fixed[self._database.stars[triangles].astype(np.intp)]
        edges = fixed[:, _FROM] - fixed[:, _TO]
        known = np.maximum((edges * edges).sum(axis=2), 1)[:, _SIDES]  # (k, 6, 3)
        low, high = (
            (np.maximum(sides, 0) * FIXED)[:, None].astype(np.float64) ** 2 / known
            for sides in (shortest, longest)
        )
        least = np.maximum(low.max(axis=2), (1 - stretch) ** 2)
        most = np.minimum(high.min(axis=2), (1 + stretch) ** 2)
        kept: Mask = least <= most
        sense = (np.linalg.det(corners) > 0) == (np.linalg.det(fixed) > 0)
        kept[:, :3] &= sense[:, None]
        kept[:, 3:] &= ~sense[:, None]
        which, orders = np.nonzero(kept)
        scales = np.sqrt((least[which, orders] + most[which, orders]) / 2).astype(_F)
        return which, orders, scales

    def _agreeing(self, turns: Floats, scales: Floats) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Catalogue stars that attitudes (k, 3, 3) put where one was measured, and near the field.

        The three of the triangle count whatever the map says.
        """
        cells = self._map
        boresights = np.rint(turns[:, 2].astype(np.float64) * FIXED)
        along = boresights @ self._fixed.T.astype(np.float64)
        limit = (self._field.smallest_cosine - 1e-4) * float(FIXED) ** 2
        which, stars = np.nonzero(along >= limit)
        seen = np.einsum("nij,nj->ni", turns[which], self._database.vectors[stars])
        across = seen[:, :2] / np.maximum(seen[:, 2:], _F(0.1)) * scales[which, None]
        places = across / self._field.scale + self._field.centre
        columns, rows = np.rint(places.T / CELL).astype(np.intp)
        inside = (columns >= 0) & (rows >= 0) & (columns < cells.shape[1]) & (rows < cells.shape[0])
        hits = np.zeros(len(which), bool)
        hits[inside] = cells[rows[inside], columns[inside]]
        count = len(turns)
        return np.bincount(which, hits, count).astype(int), np.bincount(which, minlength=count)

    @cached_property
    def _fixed(self) -> NDArray[np.int64]:
        """The catalogue's directions in integers, (n, 3)."""
        return np.rint(self._database.vectors.astype(np.float64) * FIXED).astype(np.int64)

    @cached_property
    def _map(self) -> Mask:
        """Which cells of the picture are within reach of a measured star."""
        reach_px = self._picture.margin_rad / self._field.scale[1]
        cells = np.zeros((self._field.rows // CELL + 1, self._field.columns // CELL + 1), bool)
        span = int(reach_px // CELL) + 1
        around = np.mgrid[-span : span + 1, -span : span + 1].reshape(2, -1).T
        around = around[np.hypot(*(CELL * around).T) <= reach_px]
        places = np.rint(self._points[:, ::-1] / CELL).astype(np.intp)
        rows, columns = (places[:, None] + around).reshape(-1, 2).T
        limit_y, limit_x = np.array(cells.shape) - 1
        cells[np.clip(rows, 0, limit_y), np.clip(columns, 0, limit_x)] = True
        meter, writes = self._picture.meter, cells.size // 32 + len(rows)
        with meter.phase("verification"):
            meter.charge(ram_write=writes, i32_add=4 * len(rows))
        return cells

    def _charge(
        self,
        listed: NDArray[np.int_],
        looked_at: NDArray[np.int_],
        near: NDArray[np.int_],
        stretch: float,
    ) -> float:
        """Charge and count triples (n,) and the attitudes (k,) that they propose; return the
        wrong ones to be expected among these."""
        meter, count, matches = self._picture.meter, len(listed), int(listed.sum())
        self.triples += count
        self.matches += matches
        with meter.phase("triangles"):
            charge_triangles(count, meter)
        with meter.phase("search"):
            looked = int(looked_at.sum())
            meter.charge(f32_add=8 * count, f32_mul=14 * count, f32_compare=16 * count)
            meter.charge(ram_read=looked + 4 * count, i32_add=2 * looked, loop=looked)
            # Three sides of integers; six orders of comparisons, most of which end at the first.
            meter.charge(ram_read=12 * matches, i32_mul=9 * matches, i32_add=40 * matches)
        with meter.phase("verification"):
            # The attitude of three stars, products with all catalogue stars, and the map.
            looks, seen = len(near), int(near.sum())
            stars = looks * len(self._database.numbers)
            meter.charge(f32_mul=81 * looks, f32_add=49 * looks, f32_div=12 * looks)
            meter.charge(f32_sqrt=4 * looks, i32_mul=3 * stars, i32_add=3 * stars, loop=stars)
            meter.charge(ram_read=3 * stars // 2 + 5 * seen, f32_mul=11 * seen, f32_add=8 * seen)
            meter.charge(f32_div=2 * seen, f32_convert=2 * seen, loop=seen)
        return looks if stretch else WRONG_SHARE * matches


def _triad(measured: Floats, known: Floats) -> Floats:
    """Rotations (k, 3, 3) that turn triangles of unit vectors (k, 3, 3) into measured ones."""
    turns: Floats = np.einsum("nai,naj->nij", _frame(measured), _frame(known)).astype(_F)
    return turns


def _frame(corners: Floats) -> Floats:
    """Three unit vectors (k, 3, 3) tied to triangles: to the middle, and aside of a corner."""
    middle = corners.sum(axis=1)
    middle /= np.sqrt((middle * middle).sum(axis=1, keepdims=True))
    edge = 2 * corners[:, 0] - corners[:, 1] - corners[:, 2]
    normal = cross(middle, edge)
    normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    axes: Floats = np.stack([middle, normal, cross(middle, normal)], axis=1)
    return axes
