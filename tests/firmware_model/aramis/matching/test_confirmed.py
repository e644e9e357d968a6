"""Attitudes that further stars confirm: what is believed, how sure it is, and when it is over.

Turns of the camera while its rows are exposed in turn are those of scipy.
"""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.matching import confirmed
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.shutter import FEWEST, at_middle_row
from cubestack.firmware_model.aramis.pipeline import VERIFIED
from cubestack.firmware_model.aramis.solution import Profile, Solution, StarList
from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.host.studies.aramis.sky import (
    FIELD,
    Light,
    Picture,
    database,
    errors_deg,
    meter,
    picture,
    pictures,
)
from tests.tiers import quick

PROFILE = VERIFIED.profile


def found(
    made: Picture, stars: StarList | None = None, noise_px: float = 0.1, profile: Profile = PROFILE
) -> Solution:
    stars = stars or made.stars
    sigma = np.full(len(stars), noise_px, np.float32)
    return identify(replace(stars, sigma_px=sigma), FIELD, profile, database(), meter())


@pytest.mark.parametrize("noise_px", quick([0.05, 0.2, 0.5], 1))
def test_confirmed_attitude_errors_match_the_reported_sigma(noise_px: float) -> None:
    """Without the lens' tolerance, an error that an exact lens does not have."""
    inside, sure = [], replace(PROFILE, judge_lens=False)
    for made in pictures(60, 7, Light(noise_px=noise_px)):
        solution = found(made, noise_px=noise_px, profile=sure)
        if solution.quaternion is None:
            continue
        assert solution.rating is not None
        turn = Rotation.from_quat(solution.quaternion.astype(np.float64)) * made.attitude.inv()
        inside.append(np.abs(turn.as_rotvec()) < solution.rating.sigma_rad)
    assert len(inside) > 50
    assert 0.55 < np.mean(inside) < 0.85


def test_tolerance_of_the_lens_widens_the_reported_sigma() -> None:
    for made in pictures(5, 7):
        sure = found(made, profile=replace(PROFILE, judge_lens=False)).rating
        doubting = found(made).rating
        assert sure is not None
        assert doubting is not None
        assert np.all(doubting.sigma_rad[:2] > sure.sigma_rad[:2])


def test_correct_focal_length_is_rarely_rescaled() -> None:
    scales = [found(made).rating.scale for made in pictures(15, 10)]  # type: ignore[union-attr]
    assert scales.count(1.0) >= 13


def test_triangle_without_confirming_stars_is_refused() -> None:
    for made in pictures(2, 11, Light(false_stars=20, most=60)):
        known = np.flatnonzero(np.isin(made.hip, database().numbers))[:3]
        false = np.flatnonzero(made.hip == 0)
        kept = np.sort(np.concatenate([known, false]))
        stars = StarList(made.stars.centroids[kept], made.stars.brightness[kept])
        assert found(made, stars).reason is Reason.UNCONFIRMED


def test_identification_stops_at_its_time_limit() -> None:
    (made,) = pictures(1, 12, Light(mag_limit=-2.0, false_stars=40, most=60))
    spent = meter()
    short = replace(PROFILE, within_ms=20.0)
    solution = identify(made.stars, FIELD, short, database(), spent)
    assert solution.reason is Reason.NO_TIME
    assert 0.02 <= spent.table.seconds(spent.total) < 0.03


def test_rejects_uncertain_rotation() -> None:
    made = pictures(1, 14)[0]
    strict = replace(PROFILE, largest_sigma_rad=1e-6)
    solution = identify(made.stars, FIELD, strict, database(), meter())
    assert (solution.quaternion, solution.reason) == (None, Reason.UNCONFIRMED)


def test_stars_that_determine_no_attitude_are_not_confirmed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (made,) = pictures(1, 15, Light(most=6))
    undetermined = Mock(side_effect=AttitudeError("the vectors all point the same way"))
    assert found(made).reason is Reason.CONFIRMED
    monkeypatch.setattr(confirmed, "robust_fit", undetermined)
    solution = found(made)
    assert (solution.quaternion, solution.reason) == (None, Reason.UNCONFIRMED)


ROLL = (0.0, 0.0, 0.0058)  #: 10 deg/s about the boresight over 33 ms, rad
ACROSS = (0.0005, 0.0009, 0.0)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def stars(rng: np.random.Generator, count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit vectors (n, 3) and heights (n,) of stars all over the field."""
    points = rng.uniform((0, 0), (FIELD.columns, FIELD.rows), (count, 2)).astype(np.float32)
    heights = points[:, 1] / np.float32(FIELD.rows) - np.float32(0.5)
    return FIELD.directions(points, meter()), heights


def turned(
    vectors: NDArray[np.float32], heights: NDArray[np.float32], turn: tuple[float, float, float]
) -> NDArray[np.float32]:
    """Where stars are at their row's time, when the camera sees them turn from row to row."""
    turns = Rotation.from_rotvec(heights[:, None] * np.array(turn))
    return turns.apply(vectors).astype(np.float32)


@pytest.mark.parametrize("turn", [ROLL, ACROSS, (0.0003, -0.0008, 0.003)])
def test_rolling_shutter_rotation_is_corrected(
    turn: tuple[float, float, float], rng: np.random.Generator
) -> None:
    vectors, heights = stars(rng, 20)
    wrong = Rotation.from_rotvec((2e-4, -1e-4, 5e-4))  # the attitude's own error is no turn
    moved = turned(vectors, heights, turn)
    predicted = wrong.apply(vectors).astype(np.float32)
    straight, weights, _ = at_middle_row(moved, predicted, heights, 1e-3, meter())
    before, after = np.abs(moved - vectors).max(), np.abs(straight - vectors).max()
    assert after < before / 8
    assert weights.min() > 0.05


def test_shutter_correction_gives_a_wrong_star_low_weight(rng: np.random.Generator) -> None:
    vectors, heights = stars(rng, 12)
    moved = turned(vectors, heights, ROLL)
    moved[3] += (3e-3, 0, 0)
    straight, weights, _ = at_middle_row(moved, vectors, heights, 1e-3, meter())
    assert weights[3] < 0.1 < np.delete(weights, 3).min()
    assert np.abs(np.delete(straight - vectors, 3, axis=0)).max() < 2e-4


def test_shutter_sigma_is_larger_with_few_stars(rng: np.random.Generator) -> None:
    """The reported uncertainty is about the real error for any stars."""
    doubts = {}
    for count in (FEWEST, 30):
        errors, told = [], []
        for _ in range(100):
            vectors, heights = stars(rng, count)
            noise = rng.normal(0, 2e-4, (count, 3)).astype(np.float32)
            moved = turned(vectors, heights, ROLL) + noise
            straight, weights, sigma = at_middle_row(moved, vectors, heights, 1e-3, meter())
            found = Rotation.align_vectors(straight, vectors, weights)[0].as_rotvec()
            errors.append(found[2])
            told.append(sigma)
        doubts[count] = np.median(told)
        assert 0.4 < np.sqrt(np.mean(np.square(errors))) / doubts[count] < 2.5
    assert doubts[FEWEST] > 2 * doubts[30]


def test_moving_stars_are_solved_for_the_middle_row() -> None:
    made = picture(np.random.default_rng(4), FIELD)
    vectors = FIELD.directions(made.stars.centroids, meter())
    heights = made.stars.centroids[:, 1] / np.float32(FIELD.rows) - np.float32(0.5)
    moved = turned(vectors, heights, ROLL)
    points = (moved[:, :2] / moved[:, 2:]) / np.array(FIELD.scale) + np.array(FIELD.centre)
    skewed = StarList(points.astype(np.float32), made.stars.brightness, 15.0, 2.5)
    errors = []
    for smear in (0.0, 15.0):
        smeared = replace(skewed, smear_px=smear)
        found = identify(smeared, FIELD, VERIFIED.profile, database(), meter())
        errors.append(max(errors_deg(found.quaternion, made.attitude)))
    assert errors[1] < errors[0] / 2
    strict = replace(VERIFIED.profile, motion_sigma_rad=0.0)
    refused = identify(skewed, FIELD, strict, database(), meter())
    assert (refused.outcome, refused.reason) == (MeasurementOutcome.NONE, Reason.SMEAR)
