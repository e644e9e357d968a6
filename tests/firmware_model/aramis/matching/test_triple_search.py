"""Triples in a promising order, and the attitudes that they suggest."""

from itertools import combinations, islice

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.matching.triple_search import TripleSearch, pyramid
from cubestack.firmware_model.mcu.costs import Meter

from ..sky import FIELD, Light, Picture, database, meter, pictures


def search(made: Picture, spent: Meter | None = None) -> TripleSearch:
    spent = spent or meter()
    vectors = FIELD.directions(made.stars.centroids, spent)
    sigma = np.full(len(vectors), 0.1 * FIELD.scale[1], np.float32)
    return TripleSearch(vectors, made.stars.centroids, sigma, FIELD, database(), 3.0, None, spent)


@pytest.mark.parametrize("count", [3, 4, 7, 12])
def test_the_order_has_every_triple_once(count: int) -> None:
    triples = list(pyramid(count))
    assert all(a < b < c for a, b, c in triples)
    assert sorted(triples) == sorted(combinations(range(count), 3))


def test_no_star_spoils_a_run_of_triples() -> None:
    triples = list(islice(pyramid(40), 500))
    for star in range(40):
        runs = "".join("x" if star in triple else " " for triple in triples).split()
        assert max(map(len, runs)) <= 3


def test_the_first_attitudes_are_right_and_turn_the_stars_where_they_are() -> None:
    for made in pictures(20, 1):
        found = next(one for one in search(made).run(6) if one is not None)
        turn = Rotation.from_matrix(found.turn.astype(np.float64)) * made.attitude.inv()
        assert np.degrees(turn.magnitude()) < 0.5
        assert (database().numbers[found.stars] == made.hip[found.measured]).all()


@pytest.mark.slow
def test_mirrored_stars_suggest_hardly_anything() -> None:
    agreeing = 0
    for made in pictures(10, 2):
        mirrored = made.stars.centroids * [-1, 1] + [FIELD.columns - 1, 0]
        made.stars.centroids[:] = mirrored
        agreeing += sum(one is not None for one in search(made).run(6))
    assert agreeing == 0


@pytest.mark.parametrize("scale", [0.97, 0.995, 1.01, 1.03])
def test_another_focal_length_is_found(scale: float) -> None:
    for made in pictures(5, 3):
        centre = np.array(FIELD.centre, np.float32)
        made.stars.centroids[:] = (made.stars.centroids - centre) * scale + centre
        found = next(one for one in search(made).run(6) if one is not None)
        assert found.scale == pytest.approx(scale, abs=0.008)


def test_time_is_charged_by_what_was_tried() -> None:
    (made,) = pictures(1, 4, Light(mag_limit=-2.0, false_stars=30))
    spent = meter()
    whole = search(made, spent)
    totals = [(whole.triples, spent.total) for _ in whole.run(4)]
    triples, cycles = np.array(totals, float).T
    assert triples[-1] > 4000
    first = triples <= 4000
    each = cycles[first][-1] / triples[first][-1]
    assert 10_000 < each < 100_000
    assert (np.diff(cycles) >= 0).all()
