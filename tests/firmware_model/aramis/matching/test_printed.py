"""Appendix E, beside the same written out loop by loop."""

from itertools import combinations, permutations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.triangles import measure_triangle
from cubestack.firmware_model.aramis.solution import NONE, StarList
from cubestack.firmware_model.interface.aramis import Reason
from tests.tiers import quick

from ..campaign import LISTED, PRINTED
from ..sky import FIELD, Light, database, meter, pictures

Array = NDArray[Any]
Named = tuple[int, ...]
SIDES = list(combinations(range(3), 2))


def triplets(corners: Array, faces: Array) -> set[Named]:
    """The database's triangles within three sigma in area and moment, one after the other."""
    onboard, found = database(), measure_triangle(corners, PRINTED.sigma_rad, meter())
    assert found is not None
    moments = onboard.moments[np.argsort(onboard.moment_triangles)]
    near = abs(onboard.areas - found.area) <= 3 * found.area_sigma
    near &= abs(moments - found.moment) <= 3 * found.moment_sigma
    return set(map(tuple, onboard.stars[near & faces[onboard.faces]].tolist()))


def listing(vectors: Array, faces: Array) -> tuple[set[Named], int]:
    """Triangles that are left, and pivots: at least one, then until a single one is left."""
    left, pivots = triplets(vectors[:3], faces), 0
    while pivots < min(3, len(vectors) - 3) and not (pivots and len(left) == 1):
        kept = (0, 2) if pivots == 1 else (0, 1)
        others = triplets(vectors[[*kept, 3 + pivots]], faces)
        pairs = {pair for other in others for pair in combinations(other, 2)}
        left = {one for one in left if pairs & set(combinations(one, 2))}
        pivots += 1
    return left, pivots


def scored(light: Array, vectors: Array, known: Array) -> list[int]:
    """The last part of the listing, in double precision; stars of the catalogue as they are."""
    scores = np.diag([min(abs(light[i] - np.delete(light, i))) for i in range(3)]) / np.mean(light)
    seen, angles = (np.arccos([of[i] @ of[j] for i, j in SIDES]) for of in (vectors, known))
    nearest = [int(np.argmin(abs(one - seen))) for one in angles]
    if tuple(nearest) in permutations(range(3)):
        for side, other in zip(SIDES, nearest, strict=True):
            star, named = ({0, 1, 2} - set(pair) for pair in (SIDES[other], side))
            scores[star.pop(), named.pop()] += np.std(angles, ddof=1) / np.mean(angles)
    return [int(np.argmax(row)) for row in scores]


@pytest.mark.parametrize("aided", [False, True])
@pytest.mark.parametrize(
    "light", quick([Light(mag_limit=5, false_stars=3), Light(), Light(noise_px=1)], 1)
)
def test_triangles_and_names_as_listed(light: Light, aided: bool) -> None:
    onboard = database()
    for made in pictures(40, 12, light):
        hint = made.boresight.astype(np.float32) if aided else None
        faces = np.ones(320, bool) if hint is None else onboard.sphere.around(hint, meter())
        vectors = FIELD.directions(made.stars.centroids, meter())
        left, pivots = listing(vectors, faces)
        names: list[int] = []
        for stars in map(list, left if len(left) == 1 else ()):
            order = scored(made.stars.brightness[:3], vectors[:3], onboard.vectors[stars])
            names = [stars[i] for i in order]
        found = identify(made.stars, FIELD, LISTED, onboard, meter(), hint)
        assert (found.pivots, found.stars[found.stars != NONE].tolist()) == (pivots, names)


def test_a_fourth_star_is_needed() -> None:
    (made,) = pictures(1, 6)
    three = StarList(made.stars.centroids[:3], made.stars.brightness[:3])
    assert identify(three, FIELD, PRINTED, database(), meter()).reason is Reason.TOO_FEW_STARS
