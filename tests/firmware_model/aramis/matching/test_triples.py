"""Candidates against a search of the whole database, and pivoting on real and invented skies."""

from collections.abc import Iterator, Sequence
from itertools import combinations, islice

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching.confirmed import DatabaseStars
from cubestack.firmware_model.aramis.matching.triangles import Triangle, measure_triangle
from cubestack.firmware_model.aramis.matching.triple_triangles import TripleTriangles, pyramid
from cubestack.firmware_model.aramis.matching.triples import Match, find_triangles, match_triple
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import Observation
from cubestack.firmware_model.star_tracker.search import Triangles
from cubestack.host.studies.aramis.sky import FIELD, Light, Picture, database, meter, pictures
from tests.tiers import quick

Vectors = NDArray[np.float32]

SIGMA = 5.6e-5


def directions(made: Picture) -> Vectors:
    return FIELD.directions(made.stars.centroids, meter())


def match(vectors: Vectors, pivots: Sequence[int], sigma: float, enough: int = 1) -> Match:
    return match_triple(vectors, (0, 1, 2), pivots, sigma, database(), None, meter(), enough)


def triangles(count: int, sigma: float, seed: int = 0) -> Iterator[tuple[Picture, Triangle]]:
    """Of the three brightest stars of each picture, if they are no line."""
    for made in pictures(count, seed):
        triangle = measure_triangle(directions(made)[:3], sigma, meter())
        if triangle is not None:
            yield made, triangle


def within(values: Vectors, middle: np.float32, sigma: np.float32) -> NDArray[np.bool_]:
    """Three standard deviations."""
    reach = np.float32(3) * sigma
    return (values >= middle - reach) & (values <= middle + reach)


def triangle_of(hip: NDArray[np.int32]) -> int | None:
    """Where the database has the triangle of three Hipparcos numbers."""
    onboard = database()
    stars = np.flatnonzero(np.isin(onboard.numbers, hip))
    if len(stars) < 3:
        return None
    places = np.flatnonzero((onboard.stars == stars).all(axis=1))
    return int(places[0]) if len(places) else None


@pytest.mark.parametrize("sigma", [3.7e-5, 1.7e-4])
@pytest.mark.parametrize("aided", [False, True])
def test_triangle_candidates_equal_brute_force_comparison(sigma: float, aided: bool) -> None:
    onboard = database()
    all_moments = np.empty_like(onboard.moments)
    all_moments[onboard.moment_triangles] = onboard.moments
    for made, triangle in triangles(40, sigma):
        faces = onboard.sphere.around(made.boresight.astype(np.float32), meter()) if aided else None
        found = find_triangles(triangle, onboard, faces, meter())
        expected = within(onboard.areas, triangle.area, triangle.area_sigma)
        expected &= within(all_moments, triangle.moment, triangle.moment_sigma)
        if faces is not None:
            expected &= faces[onboard.faces]
        assert sorted(found.tolist()) == np.flatnonzero(expected).tolist()


def test_search_reads_less_than_a_hundredth_of_the_database() -> None:
    onboard = database()
    for _, triangle in triangles(60, SIGMA, seed=1):
        for index, values, middle, sigma in (
            (onboard.area_index, onboard.areas, triangle.area, triangle.area_sigma),
            (onboard.moment_index, onboard.moments, triangle.moment, triangle.moment_sigma),
        ):
            reach = np.float32(3) * sigma
            places = index.find(values, middle - reach, middle + reach, meter())
            assert places.looked_at < 0.01 * len(onboard)


@pytest.mark.slow
def test_true_triangle_is_nearly_always_a_candidate() -> None:
    """Two bounds of three sigma that are not independent: at least 99 % with the right noise."""
    onboard, found, listed = database(), 0, 0
    sigma = 0.1 * FIELD.scale[0]
    for made in pictures(300, seed=2):
        true = triangle_of(made.hip[:3])
        if true is None:
            continue
        triangle = measure_triangle(directions(made)[:3], sigma, meter())
        listed += 1
        found += true in find_triangles(triangle, onboard, None, meter())
    assert listed > 270
    assert found >= 0.985 * listed


@pytest.mark.slow
def test_pivots_leave_the_true_triangle() -> None:
    ends = []
    for made in pictures(100, seed=3):
        true = triangle_of(made.hip[:3])
        if true is None or any(triangle_of(made.hip[[0, 1, star]]) is None for star in (3, 5)):
            continue
        found = match(directions(made), (3, 4, 5), 2 * SIGMA)
        if found.end is Reason.UNIQUE:
            assert found.candidates.tolist() == [true]
        ends.append(found.end)
    assert ends.count(Reason.UNIQUE) > 0.9 * len(ends)


def test_each_pivot_star_reduces_the_candidates() -> None:
    for made in pictures(20, seed=4):
        found = [match(directions(made), (3, 4, 5)[:count], 2e-4) for count in range(4)]
        left = [set(one.candidates.tolist()) for one in found]
        assert left[3] <= left[2] <= left[1] <= left[0]


def test_pivot_survivors_share_two_stars_with_a_candidate_of_each_pivot() -> None:
    """The pivots are 1 2 4, 1 3 5 and 1 2 6, counted from 1."""
    onboard, sigma, thinned = database(), 4e-4, 0
    for made in pictures(10, seed=5):
        vectors = directions(made)
        left = match(vectors, (), sigma).candidates
        for pivots, corners in ((1, (0, 1, 3)), (2, (0, 2, 4)), (3, (0, 1, 5))):
            triangle = measure_triangle(vectors[list(corners)], sigma, meter())
            if triangle is None or len(left) < 2:
                break
            others = onboard.stars[find_triangles(triangle, onboard, None, meter())].tolist()
            pairs = {pair for other in others for pair in combinations(other, 2)}
            rows = onboard.stars[left].tolist()
            before, left = left, left[[bool(pairs & set(combinations(row, 2))) for row in rows]]
            thinned += len(left) < len(before)
            after = match(vectors, (3, 4, 5)[:pivots], sigma)
            assert after.candidates.tolist() == left.tolist()
    assert thinned > 10


def test_triangle_search_includes_areas_at_both_bounds() -> None:
    """With a moment that excludes nothing, the candidates are a stretch of the list of areas."""
    onboard, rng = database(), np.random.default_rng(7)
    for _ in range(20):
        first, last = np.sort(rng.integers(0, len(onboard), 2))
        low, high = float(onboard.areas[first]), float(onboard.areas[last])
        middle, sigma = np.float32((low + high) / 2), np.float32((high - low) / 6)
        sides = np.ones(3, dtype=np.float32)
        triangle = Triangle(sides, middle, np.float32(0), sigma, onboard.moments[-1])
        inside = within(onboard.areas, triangle.area, triangle.area_sigma)
        found = find_triangles(triangle, onboard, None, meter())
        assert np.sort(found).tolist() == np.flatnonzero(inside).tolist()


def test_search_skips_pivots_when_candidates_are_few_enough() -> None:
    (made,) = pictures(1, seed=6)
    vectors = directions(made)
    plain = match(vectors, (), 1e-4)
    assert len(plain.candidates) > 1
    enough = match(vectors, (3, 4, 5), 1e-4, len(plain.candidates))
    assert enough.pivots == 0
    assert enough.candidates.tolist() == plain.candidates.tolist()


@pytest.mark.parametrize(
    ("vectors", "end"),
    [([[1, 0, 0], [0, 1, 0], [0, 0, 1]], Reason.NO_TRIANGLE), ([[0, 0, 1]] * 3, Reason.DEGENERATE)],
)
def test_triangle_absent_from_the_catalogue_is_refused(
    vectors: list[list[int]], end: Reason
) -> None:
    found = match(np.array(vectors, dtype=np.float32), (), SIGMA)
    assert (found.end, len(found.candidates)) == (end, 0)


def test_triple_matching_charges_its_phases() -> None:
    (made,) = pictures(1, seed=6)
    spent = meter()
    match_triple(directions(made), (0, 1, 2), (3, 4, 5), 2e-4, database(), None, spent)
    assert set(spent.phases) == {"triangles", "search", "pivoting"}
    assert all(spent.phases.values())


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
def test_pyramid_order_contains_every_triple_once(count: int) -> None:
    triples = list(pyramid(count))
    assert all(a < b < c for a, b, c in triples)
    assert sorted(triples) == sorted(combinations(range(count), 3))


def test_no_star_occurs_in_more_than_3_consecutive_triples() -> None:
    triples = list(islice(pyramid(40), 500))
    for star in range(40):
        runs = "".join("x" if star in triple else " " for triple in triples).split()
        assert max(map(len, runs)) <= 3


def test_first_triangles_found_are_right() -> None:
    for made in pictures(20, 1):
        found = Search(made).first()
        assert (database().numbers[found.stars] == made.hip[found.centroids]).all()


@pytest.mark.slow
def test_mirrored_stars_yield_no_triangles() -> None:
    for made in pictures(10, 2):
        mirrored = made.stars.centroids * [-1, 1] + [FIELD.columns - 1, 0]
        made.stars.centroids[:] = mirrored
        assert not any(len(step.stars) for step in Search(made).steps(6))


@pytest.mark.parametrize("scale", quick([0.97, 0.995, 1.01, 1.03], 1))
def test_triangle_search_estimates_the_focal_length_error(scale: float) -> None:
    for made in pictures(5, 3):
        centre = np.array(FIELD.centre, np.float32)
        made.stars.centroids[:] = (made.stars.centroids - centre) * scale + centre
        assert 1 / Search(made).first().factors == pytest.approx(scale, abs=0.008)


def test_triangles_far_from_the_hint_are_excluded() -> None:
    (made,) = pictures(1, 5)
    for hint, found in ((made.boresight, True), (-made.boresight, False)):
        search = Search(made)
        search.aim(hint.astype(np.float32), 6.0)
        assert any(len(step.stars) for step in search.steps(6)) == found


def test_triangle_search_is_charged_per_triple_tried() -> None:
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
