"""Confirming attitudes: true ones are, false ones are not, and chance is counted honestly."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.matching.verification import Confirmation, confirm, sides_agree
from cubestack.firmware_model.aramis.pipeline import VERIFIED
from cubestack.firmware_model.aramis.solution import StarList

from ..sky import FIELD, Light, Picture, database, meter, pictures

TOLERANCE = 1.2e-3


def check(
    made: Picture, attitude: Rotation, tolerance: float = TOLERANCE, tried: int = 1
) -> Confirmation:
    vectors = FIELD.directions(made.stars.centroids, meter())
    quaternion = attitude.as_quat().astype(np.float32)
    return confirm(quaternion, vectors, database(), FIELD, tolerance, tried, meter())


def test_true_attitudes_are_confirmed_by_the_true_stars() -> None:
    named = wrong = 0
    for made in pictures(30, 1):
        found = check(made, made.attitude)
        assert found.chance < 1e-4
        assert len(found.measured) > 0.8 * found.expected
        numbers = database().numbers[found.stars]
        named += len(numbers)
        wrong += int((numbers != made.hip[found.measured]).sum())
    assert wrong <= 0.005 * named  # companions closer than the noise


def test_expected_stars_are_those_in_the_field() -> None:
    onboard = database()
    for made in pictures(20, 2):
        camera = made.attitude.apply(onboard.vectors.astype(np.float64))
        inside = camera[:, 2] > FIELD.smallest_cosine
        assert abs(check(made, made.attitude).expected - inside.sum()) <= 1


def test_random_attitudes_are_not() -> None:
    rng = np.random.default_rng(30)
    for made in pictures(40, 3, Light(false_stars=20)):
        assert check(made, Rotation.random(random_state=rng)).chance > 1e-4


def test_no_star_is_used_twice() -> None:
    for made in pictures(20, 4):
        found = check(made, made.attitude, 0.05)
        for used in (found.measured.tolist(), found.stars.tolist()):
            assert len(set(used)) == len(used)


def test_chance_is_what_dice_give() -> None:
    """Stars that agree with attitudes at random: not more than the formula's share of the field."""
    rng, tolerance = np.random.default_rng(5), 0.008
    agreed = expected = 0.0
    for made in pictures(20, 6):
        share = len(made.stars) * np.pi * tolerance**2 / FIELD.solid_angle_sr
        for _ in range(50):
            found = check(made, Rotation.random(random_state=rng), tolerance)
            agreed += len(found.measured)
            expected += found.expected * share
    assert 0.8 * expected < agreed < 1.05 * expected


@pytest.mark.parametrize("stars", [0, 1, 2])
def test_hardly_any_star(stars: int) -> None:
    (made,) = pictures(1, 7)
    few = StarList(made.stars.centroids[:stars], made.stars.brightness[:stars])
    found = check(replace(made, stars=few), made.attitude)
    assert len(found.measured) <= stars
    assert found.chance >= 1


@pytest.mark.parametrize("seed", range(10))
def test_chance_bounds_the_binomial_tail(seed: int) -> None:
    """The first term of the tail without its factor below 1: never less, and not much more."""
    (made,) = pictures(1, seed)
    found = check(made, made.attitude)
    share = len(made.stars) * np.pi * TOLERANCE**2 / FIELD.solid_angle_sr
    further, agreed = found.expected - 3, len(found.measured) - 3
    tail = stats.binom.sf(agreed - 1, further, share)
    assert tail / 1.001 <= found.chance <= 1.1 * tail


def test_hypotheses_raise_the_chance() -> None:
    (made,) = pictures(1, 8)
    one, ten = (check(made, made.attitude, tried=tried).chance for tried in (1, 10))
    assert ten == pytest.approx(10 * one)


def test_sides() -> None:
    vectors = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]], dtype=np.float32)
    for star in range(3):
        moved = vectors.copy()
        moved[star, 0] += 1e-3
        assert not sides_agree(vectors, moved, 2e-4, meter())
        assert sides_agree(vectors, moved, 2e-3, meter())
    turned = vectors[:, [1, 2, 0]]
    assert sides_agree(vectors, turned, 1e-5, meter())
    assert not sides_agree(vectors, np.full((3, 3), np.nan, dtype=np.float32), 1, meter())


def test_a_mirror_image_does_not_agree() -> None:
    """An isosceles triangle with two stars exchanged: its sides are the same."""
    vectors = np.array([[0, 0, 1], [0.1, 0.1, 1], [-0.1, 0.1, 1]], dtype=np.float32)
    assert sides_agree(vectors, vectors, 1e-6, meter())
    assert not sides_agree(vectors, vectors[[0, 2, 1]], 1e-3, meter())


def test_stars_of_a_cluster_alone_confirm_nothing() -> None:
    """Beside the Pleiades, a turn of 1.2 deg about them keeps all of them within reach."""
    sky = load_sky(mag_limit=6.0)
    pleiad = sky.vectors[np.searchsorted(sky.hip, 17702)]
    turn = Rotation.from_rotvec(np.radians(1.2) * pleiad)
    cluster = sky.vectors[np.degrees(np.arccos(np.clip(sky.vectors @ pleiad, -1, 1))) < 0.8]
    truth, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [pleiad])
    measured = truth.apply(cluster).astype(np.float32)
    quaternion = (truth * turn).as_quat().astype(np.float32)
    found = confirm(quaternion, measured, database(), Field(), TOLERANCE, 1, meter())
    assert len(found.measured) >= 3
    assert found.spread_rad < VERIFIED.profile.spread_rad
    (made,) = pictures(1, 4)
    assert check(made, made.attitude).spread_rad > 2 * VERIFIED.profile.spread_rad
