"""Planar and spherical triangles: area and polar moment of the three brightest stars, and pivots.

AraMiS thesis, sections 5.4 to 5.8 (after Cole and Crassidis). The list of triangles is sorted by
area and by moment, each with a k-vector; a triangle must be within three standard deviations of
both. Up to three triangles with a further star leave one candidate; then order of brightness and
sides name the stars. Search and naming are those of AraMiS' firmware, which is the planar method.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.catalogue.geodesic import GeodesicSphere
from cubestack.firmware_model.aramis.catalogue.kvector import KVector
from cubestack.firmware_model.aramis.matching.assignment import assign
from cubestack.firmware_model.aramis.matching.triangles import (
    Triangle,
    measure_triangle,
    measure_triangles,
)
from cubestack.firmware_model.aramis.matching.triples import PIVOT_PAIRS, find_triangles
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import FLOAT, INDEX, START, Catalogue, index_bytes
from cubestack.host.studies.compare.tracker import NONE, Floats, Image, Indices

Vectors = NDArray[np.float64]

DEPTH = 2
"""Divisions of a spherical triangle for its moment: 16 parts (chosen). The list uses the same."""

CHUNK = 20_000
CANDIDATES = 4096  #: entries that the part has room for (chosen)
_PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Shape:
    """How a triangle is measured."""

    #: areas and moments (n,) of triangles (n, 3, 3)
    properties: Callable[[Floats], tuple[Floats, Floats]]
    #: of three unit vectors with an error in rad; None on a line
    measure: Callable[[Floats, float, Meter], Triangle | None]


class Areas:
    """Uses the three brightest stars, and three more as pivots."""

    def __init__(self, catalogue: Catalogue, shape: Shape) -> None:
        tracker = catalogue.tracker
        self.shape = shape
        #: three standard deviations of an angle are the margin of the other methods
        self.sigma = tracker.margin_rad / (3 * np.sqrt(2))
        self.database = triangle_list(catalogue, shape)
        count = len(self.database)
        entry = 3 * INDEX + 2 * FLOAT + START  # stars, area; moment and its triangle
        self.database_bytes = count * entry + 2 * index_bytes(count) + catalogue.star_bytes
        self.database_bytes += len(catalogue.vectors) * FLOAT  # magnitudes
        self.ram_bytes = 2 * CANDIDATES * START

    def __call__(self, image: Image, meter: Meter) -> Indices:
        names = np.full(len(image.rays), NONE)
        if len(image.rays) < 3:
            return names
        main = self.shape.measure(image.rays[:3], self.sigma, meter)
        if main is None:
            return names
        left = find_triangles(main, self.database, None, meter)
        for (one, other), star in zip(PIVOT_PAIRS, range(3, len(image.rays)), strict=False):
            if len(left) <= 1:
                break
            pivot = self.shape.measure(image.rays[[one, other, star]], self.sigma, meter)
            if pivot is not None:
                others = find_triangles(pivot, self.database, None, meter)
                left = left[self._share_pair(left, others, meter)]
        if len(left) == 1:
            stars = self.database.stars[left[0]].astype(np.intp)
            v_mag, known = self.database.v_mag[stars], self.database.vectors[stars]
            found = assign(image.brightness[:3], main.sides, v_mag, known, meter)
            names[:3] = stars[found.order]
        return names

    def _share_pair(
        self, left: NDArray[np.uint32], others: NDArray[np.uint32], meter: Meter
    ) -> NDArray[np.bool_]:
        """Which triangles share two stars with one of the others: both sorted, then compared."""
        wanted, listed = (
            np.stack([found[:, one] * 65536 + found[:, other] for one, other in _PAIRS])
            for found in (self.database.stars[rows].astype(np.int64) for rows in (left, others))
        )
        words = wanted.size + listed.size
        steps = words * int(np.ceil(np.log2(listed.size + 1)))
        meter.charge(ram_read=words + steps, ram_write=listed.size, i32_add=2 * words + steps)
        meter.charge(loop=steps)
        return np.asarray(np.isin(wanted, listed).any(axis=0))


def triangle_list(catalogue: Catalogue, shape: Shape) -> Database:
    """AraMiS' database of a tracker's triangles, without faces."""
    triangles, stars = catalogue.triangles, catalogue.tracker.stars
    parts = [
        shape.properties(stars[triangles[start : start + CHUNK]])
        for start in range(0, len(triangles), CHUNK)
    ]
    areas, moments = (np.concatenate(each).astype(np.float32) for each in zip(*parts, strict=True))
    order = np.argsort(areas, kind="stable")
    order = order[areas[order] > 0]
    triangles, areas, moments = triangles[order], areas[order], moments[order]
    by_moment = np.argsort(moments, kind="stable")
    return Database(
        epoch=0.0,
        fov_deg=float(np.degrees(catalogue.tracker.pair_limit_rad)),
        numbers=np.arange(len(stars), dtype=np.uint32),
        vectors=stars,
        v_mag=catalogue.tracker.v_mag.astype(np.float32),
        stars=triangles.astype(np.uint16),
        faces=np.zeros(0, np.uint16),
        areas=areas,
        moments=moments[by_moment],
        moment_triangles=by_moment.astype(np.uint32),
        area_index=KVector.build(areas),
        moment_index=KVector.build(moments[by_moment]),
        sphere=GeodesicSphere(np.zeros((0, 3), np.float32), np.zeros((0, 12), np.uint16)),
    )


def _planar(corners: Floats) -> tuple[Floats, Floats]:
    found = measure_triangles(corners, np.ones(corners.shape[:2], np.float32))
    return found.area, found.moment


PLANAR = Shape(_planar, measure_triangle)
"""Equations 5.7 to 5.21."""


def spherical(corners: Floats) -> tuple[Floats, Floats]:
    """Areas in sr and polar moments of spherical triangles (n, 3, 3): equations 5.1 and 5.6.

    The area is the solid angle by Van Oosterom and Strackee, equal to equation 5.1. The moment adds
    up parts: a triangle is divided at the middles of its sides, again and again.
    """
    whole = corners.astype(np.float64)
    parts = whole[:, None]
    for _ in range(DEPTH):
        a, b, c = (parts[:, :, k] for k in range(3))
        ab, bc, ca = _unit(a + b), _unit(b + c), _unit(c + a)
        split = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        parts = np.concatenate([np.stack(part, axis=2) for part in split], axis=1)
    middle = _unit(whole.sum(axis=1))
    apart = np.linalg.norm(_unit(parts.sum(axis=2)) - middle[:, None], axis=2)
    theta = 2 * np.arcsin(np.minimum(apart / 2, 1))
    moments = (theta**2 * _solid_angle(parts)).sum(axis=1)
    return _solid_angle(whole).astype(np.float32), moments.astype(np.float32)


def _measure_spherical(vectors: Floats, sigma_rad: float, meter: Meter) -> Triangle | None:
    """The bounds have the shares of the planar triangle's, of which the thesis has equations."""
    flat = measure_triangle(vectors, sigma_rad, meter)
    if flat is None:
        return None
    parts = 4**DEPTH
    areas, moments = spherical(vectors[None])
    # Equation 5.1: three arc cosines, four tangents, a root and an arc tangent; then a part's
    # middle, its distance and the sum; each division has three middles of sides.
    triangles, middles = parts + 1, 3 * (parts - 1) // 3 + parts + 1
    meter.charge(f32_acos=3 * triangles + parts, f32_sin=8 * triangles, f32_sqrt=triangles)
    meter.charge(f32_div=4 * triangles, f32_mul=(9 + 5) * triangles, f32_add=(6 + 6) * triangles)
    meter.charge(f32_atan2=triangles, loop=triangles, call=triangles)
    meter.charge(f32_sqrt=middles, f32_div=middles, f32_mul=6 * middles, f32_add=8 * middles)
    meter.charge(f32_mul=5 * parts, f32_add=3 * parts, f32_div=2)
    return replace(
        flat,
        area=areas[0],
        moment=moments[0],
        area_sigma=flat.area_sigma * areas[0] / flat.area,
        moment_sigma=flat.moment_sigma * moments[0] / flat.moment,
    )


SPHERICAL = Shape(spherical, _measure_spherical)


def _unit(vectors: Vectors) -> Vectors:
    found: Vectors = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found


def _solid_angle(corners: Vectors) -> Vectors:
    """Of spherical triangles (..., 3, 3), in sr."""
    a, b, c = (corners[..., k, :] for k in range(3))
    volume = np.abs((a * np.cross(b, c)).sum(axis=-1))
    cosines = ((one * other).sum(axis=-1) for one, other in ((a, b), (b, c), (c, a)))
    found: Vectors = 2 * np.arctan2(volume, 1 + sum(cosines))
    return found
