"""Area, moment and their noise against geometry in double precision and against dice; who is
who in a triangle, against all six ways of naming three stars.
"""

from itertools import combinations, permutations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching.assignment import assign, dispersion, variation
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.triangles import Triangle, measure_triangle
from cubestack.firmware_model.aramis.solution import NONE, StarList
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.host.studies.aramis.sky import FIELD, Light, database, meter, pictures
from cubestack.host.studies.aramis.stars_alone import LISTED, PRINTED
from tests.tiers import quick
from tests.together import together

Array = NDArray[Any]


def in_field(rng: np.random.Generator, count: int = 1) -> Array:
    """Triples of unit vectors (count, 3, 3) in a field of 21 degrees."""
    points = rng.uniform(-0.13, 0.13, (count, 3, 2))
    vectors = np.concatenate([points, np.ones((count, 3, 1))], axis=2)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=2, keepdims=True))


def truth(corners: Array) -> tuple[Array, Array]:
    """Areas by the cross product, and moments as sums of squared distances over 36."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2
    squares = sum(np.sum((p - q) ** 2, axis=-1) for p, q in ((a, b), (b, c), (a, c)))
    return area, area * squares / 36


def measure(corners: Array, sigma: float = 1e-4) -> Triangle:
    return measure_triangle(corners.astype(np.float32), sigma, meter())


@together("seed", range(100))
def test_triangle_area_and_moment_match_double_precision(seed: int) -> None:
    (corners,) = in_field(np.random.default_rng(seed))
    triangle = measure(corners)
    area, moment = truth(corners)
    assert triangle.area == pytest.approx(area, rel=1e-3, abs=1e-7)
    assert triangle.moment == pytest.approx(moment, rel=1e-3, abs=1e-9)


def test_triangle_moment_is_the_second_moment_of_its_area() -> None:
    """Second moment about the middle, over points spread evenly in the triangle."""
    corners = np.array([[0, 0, 1.0], [0.1, 0, 1], [0.03, 0.08, 1]])
    u, v = np.random.default_rng(1).uniform(size=(2, 400_000))
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    points = (
        corners[0] + u[:, None] * (corners[1] - corners[0]) + v[:, None] * (corners[2] - corners[0])
    )
    area, moment = truth(corners)
    mean = np.mean(np.sum((points - corners.mean(axis=0)) ** 2, axis=1))
    assert area * mean == pytest.approx(moment, rel=0.01)


@together("seed", range(20))
def test_triangle_sigmas_match_simulated_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sigma = 1e-4
    while True:
        (corners,) = in_field(rng)
        if truth(corners)[0] > 1e-3:  # far from a line, where no linear theory holds
            break
    noise = rng.normal(0, sigma, (20_000, 3, 3))
    noise -= np.sum(noise * corners, axis=2, keepdims=True) * corners
    thrown = corners + noise
    thrown /= np.linalg.norm(thrown, axis=2, keepdims=True)
    areas, moments = truth(thrown)
    triangle = measure(corners, sigma)
    assert triangle.area_sigma == pytest.approx(areas.std(), rel=0.04)
    assert triangle.moment_sigma == pytest.approx(moments.std(), rel=0.04)


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1)])
def test_triangle_measures_do_not_depend_on_the_star_order(order: tuple[int, ...]) -> None:
    (corners,) = in_field(np.random.default_rng(7))
    first, second = measure(corners), measure(corners[list(order)])
    for name in ("area", "moment", "area_sigma", "moment_sigma"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-4)


def test_sides_are_in_the_order_of_the_equations() -> None:
    corners = np.array([[0, 0, 1.0], [0.1, 0, 1], [0, 0.2, 1]])
    sides = measure(corners).sides
    np.testing.assert_allclose(sides, [0.1, np.hypot(0.1, 0.2), 0.2], rtol=1e-5)


@pytest.mark.parametrize("corners", [np.zeros((3, 3)), np.eye(3)[[0, 0, 1]]])
def test_stars_on_a_line_give_no_triangle(corners: Array) -> None:
    assert measure_triangle(corners.astype(np.float32), 1e-4, meter()) is None


def test_triangle_cost_does_not_depend_on_its_position() -> None:
    costs = set()
    for corners in in_field(np.random.default_rng(3), 10):
        spent = meter()
        measure_triangle(corners.astype(np.float32), 1e-4, spent)
        costs.add(spent.total)
    (cost,) = costs
    assert 5_000 < cost < 50_000


Vectors = NDArray[np.float32]

MAGNITUDES = np.array([1.0, 2.0, 3.0], dtype=np.float32)


def corners(seed: int) -> Vectors:
    return in_field(np.random.default_rng(seed))[0].astype(np.float32)


def sides(vectors: Vectors) -> Vectors:
    return measure_triangle(vectors, 1e-4, meter()).sides


def brightness(magnitudes: Vectors) -> Vectors:
    return (1000 * 10 ** (-0.4 * magnitudes)).astype(np.float32)


@together("seed", range(10))
@together("order", list(permutations(range(3))))
def test_brightness_and_side_criteria_assign_the_same_order(
    seed: int, order: tuple[int, ...]
) -> None:
    """Measured star i is the catalogue's star order[i]."""
    catalogue, picked = corners(seed), list(order)
    found = assign(
        brightness(MAGNITUDES)[picked], sides(catalogue[picked]), MAGNITUDES, catalogue, meter()
    )
    assert found.order.tolist() == found.other.tolist() == picked
    assert (found.scores > 0).sum() == 3


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_assignment_uses_the_criterion_with_larger_variation(order: tuple[int, ...]) -> None:
    catalogue, picked = corners(3), list(order)
    wrong = np.roll(picked, 1)
    measured = sides(catalogue[picked])
    light = brightness(MAGNITUDES)[wrong]
    strong = assign(light, measured, MAGNITUDES, catalogue, meter())
    assert [strong.order.tolist(), strong.other.tolist()] == [wrong.tolist(), picked]
    even = np.float32(1) + np.float32(0.001) * light / np.float32(1000)
    weak = assign(even, measured, MAGNITUDES, catalogue, meter())
    assert [weak.order.tolist(), weak.other.tolist()] == [picked, wrong.tolist()]


def test_assignment_scores_are_coefficients_of_variation() -> None:
    catalogue = corners(5)
    light, measured = brightness(MAGNITUDES), sides(catalogue)
    scores = assign(light, measured, MAGNITUDES, catalogue, meter()).scores
    expected = np.std(light, ddof=1) / np.mean(light) + np.std(measured, ddof=1) / np.mean(measured)
    np.testing.assert_allclose(scores, np.eye(3) * expected, rtol=1e-5)


def test_variance_lets_counts_outweigh_sides() -> None:
    """Section 5.8's words: the score has a unit, so brightness decides even where it hardly
    differs."""
    catalogue, wrong = corners(3), np.roll(range(3), 1).tolist()
    counts = np.float32(1e4) * (1000 + brightness(MAGNITUDES)[wrong] / np.float32(100))
    compared = counts, sides(catalogue), MAGNITUDES, catalogue, meter()
    assert assign(*compared).order.tolist() == [0, 1, 2]
    assert assign(*compared, by_variance=True).order.tolist() == wrong
    values = np.array([2, 5, 9], np.float32)
    assert dispersion(values, meter()) == pytest.approx(np.var(values, ddof=1) / values.mean())


def test_variation_does_not_depend_on_the_unit() -> None:
    values = np.array([2, 5, 9], dtype=np.float32)
    first, second = variation(values, meter()), variation(values * np.float32(1000), meter())
    assert first == pytest.approx(np.std([2, 5, 9], ddof=1) / np.mean([2, 5, 9]), rel=1e-6)
    assert second == pytest.approx(first, rel=1e-5)


def test_equal_values_have_zero_variation() -> None:
    assert variation(np.full(3, 7, dtype=np.float32), meter()) == 0
    assert variation(np.zeros(3, dtype=np.float32), meter()) == 0


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


@pytest.mark.parametrize("aided", quick([False, True], 1))
@pytest.mark.parametrize(
    "light", quick([Light(mag_limit=5, false_stars=3), Light(), Light(noise_px=1)], 1)
)
def test_triangles_and_identities_equal_the_printed_listing(light: Light, aided: bool) -> None:
    onboard = database()
    for made in pictures(15, 12, light):
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


def test_identification_with_three_stars_is_refused() -> None:
    (made,) = pictures(1, 6)
    three = StarList(made.stars.centroids[:3], made.stars.brightness[:3])
    assert identify(three, FIELD, PRINTED, database(), meter()).reason is Reason.TOO_FEW_STARS
