"""Which triangles of the database a measured one can be, and pivoting to leave only one.

AraMiS thesis, sections 5.5 to 5.7 and 5.9. A triangle is a candidate when its area and its moment
both lie within three standard deviations of the measured ones. When several are left, a pivot
triangle is measured, which keeps two stars and takes a further one: candidates stay that share two
stars with a candidate of the pivot. With stars 1, 2 and 3 as the main triangle, the pivots are
1 2 4, 1 3 5 and 1 2 6: each brings a further star, so six stars allow three pivots (the pairs are
those of appendix E). With a rough direction, only the face in which it falls and those around it
are searched.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.matching.ranges import triangles_within
from cubestack.firmware_model.aramis.matching.triangles import Triangle, measure_triangle
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.firmware_model.mcu.costs import Meter

BOUND_SIGMAS = np.float32(3)

#: Which two stars of the main triangle each pivot keeps.
PIVOT_PAIRS = ((0, 1), (0, 2), (0, 1))

#: The three pairs of a triangle's stars.
_FIRST, _SECOND = [0, 0, 1], [1, 2, 2]


@dataclass(frozen=True, eq=False)
class Match:
    """How the search for one main triangle ended."""

    end: Reason
    main: Triangle | None  #: the main triangle; None when DEGENERATE
    #: triangles of the database that are left, uint32; empty when there is none
    candidates: NDArray[np.uint32]
    pivots: int  #: pivot triangles that were used

    @property
    def counts(self) -> dict[str, int]:
        """Candidates and pivots, as a solution counts them."""
        return {"candidates": len(self.candidates), "pivots": self.pivots}


_NOTHING = np.zeros(0, dtype=np.uint32)


def find_triangles(
    triangle: Triangle, database: Database, faces: Mask | None, meter: Meter
) -> NDArray[np.uint32]:
    """Triangles of the database within the bounds of a measured one, in the moments' order.

    Only those of ``faces`` (f,) count; None: all.
    """
    area, area_reach = triangle.area, BOUND_SIGMAS * triangle.area_sigma
    bounds = area - area_reach, area + area_reach
    areas = database.area_index.find(database.areas, *bounds, meter)
    moment, moment_reach = triangle.moment, BOUND_SIGMAS * triangle.moment_sigma
    bounds = moment - moment_reach, moment + moment_reach
    moments = database.moment_index.find(database.moments, *bounds, meter)
    meter.charge(f32_mul=2, f32_add=4)
    # Triangles are in the order of their area, so the intersection is a comparison of indices.
    first, last = np.array([areas.start]), np.array([areas.stop])
    ranges = np.array([moments.start]), np.array([len(moments)])
    found, _ = triangles_within(database, ranges, (first, last), None)
    meter.charge(ram_read=len(moments), i32_add=2 * len(moments), loop=len(moments))
    if faces is not None:
        meter.charge(ram_read=2 * len(found), loop=len(found))
        found = found[faces[database.faces[found]]]
    meter.charge(ram_write=len(found))
    return found


def match_triple(
    vectors: Floats,
    main: Sequence[int],
    pivots: Sequence[int],
    sigma_rad: float,
    database: Database,
    faces: Mask | None,
    meter: Meter,
    enough: int | None = 1,
) -> Match:
    """Match the triangle of three stars, with pivots while too many candidates are left.

    Phases: `triangles`, `search` and `pivoting`.

    Args:
        vectors: (n, 3) unit vectors of the stars in camera axes, with noise ``sigma_rad`` per axis.
        main, pivots: stars of the main triangle, the brightest first; at most three further stars.
        faces: (f,) which faces count; None: all.
        enough: candidates for which no pivot is needed, 1 in section 5.7; None: as in appendix E,
            one pivot at least, and further ones until one candidate is left, not none.
    """
    with meter.phase("triangles"):
        triangle = measure_triangle(vectors[list(main)], sigma_rad, meter)
    if triangle is None:
        return Match(Reason.DEGENERATE, None, _NOTHING, 0)
    with meter.phase("search"):
        left = find_triangles(triangle, database, faces, meter)
    nothing = Reason.NO_SHARED_PAIR if len(left) else Reason.NO_TRIANGLE
    used = 0
    for (first, second), star in zip(PIVOT_PAIRS, pivots, strict=False):
        if (used and len(left) == 1) if enough is None else len(left) <= enough:
            break
        used += 1
        with meter.phase("triangles"):
            pivot = measure_triangle(vectors[[main[first], main[second], star]], sigma_rad, meter)
        if pivot is None:
            continue
        with meter.phase("search"):
            others = find_triangles(pivot, database, faces, meter)
        with meter.phase("pivoting"):
            left = left[_share_pair(database.stars[left], database.stars[others], meter)]
    ends = {0: nothing, 1: Reason.UNIQUE}
    return Match(ends.get(len(left), Reason.SEVERAL), triangle, left, used)


def _share_pair(triangles: NDArray[np.uint16], others: NDArray[np.uint16], meter: Meter) -> Mask:
    """Which triangles (n,) of star triples (n, 3) share two stars with one of others (m, 3).

    The pairs of the others are sorted as 32-bit words, and each pair of this one is searched there.
    """
    wanted, listed = _pairs(triangles), _pairs(others)
    words, depth = listed.size + wanted.size, ceil(log2(listed.size + 1))
    steps = words * depth
    meter.charge(ram_read=words + steps, ram_write=listed.size * (1 + depth))
    meter.charge(i32_add=2 * words + steps, loop=steps)
    shared: Mask = np.isin(wanted, listed)
    return shared[:, 0] | shared[:, 1] | shared[:, 2]


def _pairs(triangles: NDArray[np.uint16]) -> NDArray[np.uint32]:
    """Three words (n, 3) for the pairs of star triples (n, 3) in rising order."""
    stars = triangles.astype(np.uint32)
    words = (stars[:, _FIRST] << np.uint32(16)) | stars[:, _SECOND]
    return words.astype(np.uint32)
