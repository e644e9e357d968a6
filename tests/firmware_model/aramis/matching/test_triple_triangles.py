from collections.abc import Iterator
from itertools import combinations, islice

import numpy as np
import pytest

from cubestack.firmware_model.aramis.matching.confirmed import DatabaseStars
from cubestack.firmware_model.aramis.matching.triple_triangles import TripleTriangles, pyramid
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import Observation
from cubestack.firmware_model.star_tracker.search import Triangles

from ..sky import FIELD, Light, Picture, database, meter, pictures


class Search(TripleTriangles):
    """Of a picture's stars, with errors of 0.1 px."""

    def __init__(self, made: Picture, spent: Meter | None = None) -> None:
        vectors = FIELD.directions(made.stars.centroids, meter())
        sigma = np.full(len(vectors), 0.1 * FIELD.scale[1], np.float32)
        stars = DatabaseStars(database().vectors)
        seen = Observation(vectors, stars, FIELD, 3.0 * FIELD.scale[1], spent or meter())
        super().__init__(seen, made.stars.centroids, sigma, FIELD, database())

    def steps(self, fewest: int) -> Iterator[Triangles]:
        for each in self.passes(fewest):
            yield from each.steps

    def first(self) -> Triangles:
        return next(step for step in self.steps(6) if len(step.stars))


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


def test_first_triangles_are_right() -> None:
    for made in pictures(20, 1):
        found = Search(made).first()
        assert (database().numbers[found.stars] == made.hip[found.centroids]).all()


@pytest.mark.slow
def test_mirrored_stars_suggest_hardly_anything() -> None:
    for made in pictures(10, 2):
        mirrored = made.stars.centroids * [-1, 1] + [FIELD.columns - 1, 0]
        made.stars.centroids[:] = mirrored
        assert not any(len(step.stars) for step in Search(made).steps(6))


@pytest.mark.parametrize("scale", [0.97, 0.995, 1.01, 1.03])
def test_another_focal_length_is_found(scale: float) -> None:
    for made in pictures(5, 3):
        centre = np.array(FIELD.centre, np.float32)
        made.stars.centroids[:] = (made.stars.centroids - centre) * scale + centre
        assert 1 / Search(made).first().factors == pytest.approx(scale, abs=0.008)


def test_triangles_far_from_the_hint_are_left_out() -> None:
    (made,) = pictures(1, 5)
    for hint, found in ((made.boresight, True), (-made.boresight, False)):
        search = Search(made)
        search.aim(hint.astype(np.float32), 6.0)
        assert any(len(step.stars) for step in search.steps(6)) == found


def test_time_is_charged_by_what_was_tried() -> None:
    (made,) = pictures(1, 4, Light(mag_limit=-2.0, false_stars=30))
    spent = meter()
    whole = Search(made, spent)
    totals = [(whole.triples, spent.total) for _ in whole.steps(4)]
    triples, cycles = np.array(totals, float).T
    assert triples[-1] > 4000
    first = triples <= 4000
    each = cycles[first][-1] / triples[first][-1]
    assert 10_000 < each < 100_000
    assert (np.diff(cycles) >= 0).all()
