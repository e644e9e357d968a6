"""Who is who, against all six ways of naming three stars."""

from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching.assignment import assign, variation
from cubestack.firmware_model.aramis.matching.triangles import measure_triangle

from ..sky import meter

Vectors = NDArray[np.float32]

MAGNITUDES = np.array([1.0, 2.0, 3.0], dtype=np.float32)


def corners(seed: int) -> Vectors:
    points = np.random.default_rng(seed).uniform(-0.12, 0.12, (3, 2))
    vectors = np.column_stack([points, np.ones(3)])
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def sides(vectors: Vectors) -> Vectors:
    return measure_triangle(vectors, 1e-4, meter()).sides


def brightness(magnitudes: Vectors) -> Vectors:
    return (1000 * 10 ** (-0.4 * magnitudes)).astype(np.float32)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_both_criteria_find_the_order(seed: int, order: tuple[int, ...]) -> None:
    """Measured star i is the catalogue's star order[i]."""
    catalogue, picked = corners(seed), list(order)
    found = assign(
        brightness(MAGNITUDES)[picked], sides(catalogue[picked]), MAGNITUDES, catalogue, meter()
    )
    assert found.order.tolist() == found.other.tolist() == picked
    assert (found.scores > 0).sum() == 3


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_the_more_varied_criterion_wins(order: tuple[int, ...]) -> None:
    catalogue, picked = corners(3), list(order)
    wrong = np.roll(picked, 1)
    measured = sides(catalogue[picked])
    light = brightness(MAGNITUDES)[wrong]
    strong = assign(light, measured, MAGNITUDES, catalogue, meter())
    assert [strong.order.tolist(), strong.other.tolist()] == [wrong.tolist(), picked]
    even = np.float32(1) + np.float32(0.001) * light / np.float32(1000)
    weak = assign(even, measured, MAGNITUDES, catalogue, meter())
    assert [weak.order.tolist(), weak.other.tolist()] == [picked, wrong.tolist()]


def test_scores_are_the_coefficients_of_variation() -> None:
    catalogue = corners(5)
    light, measured = brightness(MAGNITUDES), sides(catalogue)
    scores = assign(light, measured, MAGNITUDES, catalogue, meter()).scores
    expected = np.std(light, ddof=1) / np.mean(light) + np.std(measured, ddof=1) / np.mean(measured)
    np.testing.assert_allclose(scores, np.eye(3) * expected, rtol=1e-5)


def test_variation_does_not_depend_on_the_unit() -> None:
    values = np.array([2, 5, 9], dtype=np.float32)
    first, second = variation(values, meter()), variation(values * np.float32(1000), meter())
    assert first == pytest.approx(np.std([2, 5, 9], ddof=1) / np.mean([2, 5, 9]), rel=1e-6)
    assert second == pytest.approx(first, rel=1e-5)


def test_equal_values_score_nothing() -> None:
    assert variation(np.full(3, 7, dtype=np.float32), meter()) == 0
    assert variation(np.zeros(3, dtype=np.float32), meter()) == 0
