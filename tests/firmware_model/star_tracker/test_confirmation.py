"""Matching, correction and the false-alarm probability, beside what they stand for."""

from itertools import pairwise
from math import comb

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import (
    by_chance,
    correction,
    false_alarm,
    from_three,
    matched,
)


def meter() -> Meter:
    return Meter(CORTEX_M3)


def rays(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Unit vectors (count, 3) in a field of 54 x 28 deg."""
    plane = np.column_stack([rng.uniform([-0.5, -0.25], [0.5, 0.25], (count, 2)), np.ones(count)])
    return (plane / np.linalg.norm(plane, axis=1, keepdims=True)).astype(np.float32)


def test_star_matching_equals_brute_force() -> None:
    rng = np.random.default_rng(1)
    for count in (0, 1, 30):
        measured, predicted = rays(rng, count), rays(rng, 40)
        apart = np.linalg.norm(predicted[:, None] - measured[None], axis=2)
        wanted = {
            (m, p)
            for p in range(40)
            for m in range(count)
            if apart[p, m] <= 0.05 and apart[p, m] == apart[p].min() == apart[:, m].min()
        }
        rows, places, distances = matched(measured, predicted, 0.05, meter())
        assert set(zip(rows.tolist(), places.tolist(), strict=True)) == wanted
        assert distances == pytest.approx(apart[places, rows], abs=1e-6)


@pytest.mark.parametrize(("expected", "found", "chance"), [(0, 0, 0.1), (9, 3, 1e-3), (5, 5, 1e-4)])
def test_false_alarm_is_inverse_likelihood_ratio(expected: int, found: int, chance: float) -> None:
    missing = expected - found
    right, _ = quad(lambda s: s**found * (1 - s) ** missing, 0, 1)
    ratio = right / (chance**found * (1 - chance) ** missing)
    assert false_alarm(7.0, expected, found, chance, meter()) == pytest.approx(7.0 / ratio)


def test_false_alarm_rate_is_at_most_the_declared_one() -> None:
    expected, chance = 12, 0.05
    odds = [false_alarm(1.0, expected, f, chance, meter()) for f in range(expected + 1)]
    likely = [
        comb(expected, f) * chance**f * (1 - chance) ** (expected - f) for f in range(expected + 1)
    ]
    for level in odds:
        as_good = sum(p for p, other in zip(likely, odds, strict=True) if other <= level)
        assert as_good <= level


def test_false_alarm_falls_with_found_and_rises_with_missing_stars() -> None:
    more_found = [false_alarm(1.0, 10, f, 1e-3, meter()) for f in range(1, 11)]
    assert all(b < a for a, b in pairwise(more_found))
    more_missing = [false_alarm(1.0, 2 + m, 2, 1e-3, meter()) for m in range(10)]
    assert all(b > a for a, b in pairwise(more_missing))
    assert by_chance(20, 0.001, 0.4) == pytest.approx(20 * np.pi * 1e-6 / 0.4)
    assert by_chance(20, 0.1, 0.4) == 0.5  # 20 circles of 0.03 sr more than fill the picture


@pytest.mark.parametrize("with_scale", [False, True])
def test_correction_rotates_and_scales_measured_onto_predicted_vectors(with_scale: bool) -> None:
    rng = np.random.default_rng(2)
    predicted = rays(rng, 8)
    turn = Rotation.from_rotvec(0.004 * rng.normal(size=3))
    measured = turn.apply(predicted).astype(np.float32)
    if with_scale:
        measured = scaled(measured, 1 / 1.004, meter())
    rotation, factor = correction(measured, predicted, meter(), with_scale=with_scale)
    rest = Rotation.from_matrix(rotation.astype(float)) * turn.inv()
    assert rest.magnitude() < 1e-4
    assert factor == pytest.approx(1.004 if with_scale else 1.0, abs=2e-4)


def test_attitude_from_three_stars_is_exact() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        truth, reference = Rotation.random(random_state=rng), rays(rng, 3)
        measured = truth.apply(reference).astype(np.float32)
        found = Rotation.from_matrix(from_three(measured, reference, meter()).astype(float))
        assert (found * truth.inv()).magnitude() < 1e-4


def test_longer_focal_length_moves_stars_radially_only() -> None:
    rng = np.random.default_rng(4)
    directions = rays(rng, 10)
    longer = scaled(directions, 1.03, meter())
    assert np.linalg.norm(longer, axis=1) == pytest.approx(1, abs=1e-6)
    tangents, wide = directions[:, :2] / directions[:, 2:], longer[:, :2] / longer[:, 2:]
    assert wide == pytest.approx(1.03 * tangents, rel=1e-5)
    assert scaled(directions, 1.0, meter()) is directions
