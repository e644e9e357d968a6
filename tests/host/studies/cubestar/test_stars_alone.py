"""Rates of the identification alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.host.studies.cubestar.stars_alone import (
    CLAIMS,
    COUNTS,
    SKIES,
    false_alarms,
    identification,
    pictures,
    wrong_by,
)


def test_errors_are_those_of_a_turn_across_and_about_the_boresight() -> None:
    truth = Rotation.from_euler("zyx", (20, -30, 40), degrees=True).as_matrix()
    off = Rotation.from_euler("z", -0.4, degrees=True) * Rotation.from_euler("x", 1, degrees=True)
    cross_deg, roll_deg = wrong_by(off.as_matrix() @ truth, truth)
    assert cross_deg == pytest.approx(1)
    assert abs(roll_deg) == pytest.approx(0.4, abs=1e-3)


def test_each_sky_repeats_and_differs_from_the_others() -> None:
    first, again, other = (
        next(pictures(sky, 1)).rays for sky in ("uncut sky", "uncut sky", "mirrored")
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:3], other[:3])


def test_real_skies_are_right_and_mirrored_ones_refused() -> None:
    found = identification(None, 12)
    assert found["V < 3.8, 0 false stars, right"] > 80
    assert found["mirrored, right"] == 0
    assert not any(found[f"{sky}, wrong"] for sky in SKIES)
    assert max(found[f"{sky}, most ms"] for sky in SKIES) < 250


def test_false_alarms_are_fewer_than_claimed() -> None:
    found = false_alarms(None, 100)
    assert found["images"] == 100 * len(COUNTS)
    numbers = [found[f"{claim:g}, number"] for claim in CLAIMS]
    assert numbers == sorted(numbers, reverse=True)
    assert numbers[0] > 0
    for claim, number in zip(CLAIMS, numbers, strict=True):
        bound = claim * found["images"]
        assert number < bound + 3 * bound**0.5
