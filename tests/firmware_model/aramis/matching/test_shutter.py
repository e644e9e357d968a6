"""Turns of the camera while its rows are exposed in turn, against rotations of scipy."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.shutter import FEWEST, at_middle_row
from cubestack.firmware_model.aramis.pipeline import VERIFIED
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

from ..sky import FIELD, database, errors_deg, meter, picture

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
def test_a_turn_is_taken_back(turn: tuple[float, float, float], rng: np.random.Generator) -> None:
    vectors, heights = stars(rng, 20)
    wrong = Rotation.from_rotvec((2e-4, -1e-4, 5e-4))  # the attitude's own error is no turn
    moved = turned(vectors, heights, turn)
    predicted = wrong.apply(vectors).astype(np.float32)
    straight, weights, _ = at_middle_row(moved, predicted, heights, 1e-3, meter())
    before, after = np.abs(moved - vectors).max(), np.abs(straight - vectors).max()
    assert after < before / 8
    assert weights.min() > 0.05


def test_a_wrong_star_counts_less(rng: np.random.Generator) -> None:
    vectors, heights = stars(rng, 12)
    moved = turned(vectors, heights, ROLL)
    moved[3] += (3e-3, 0, 0)
    straight, weights, _ = at_middle_row(moved, vectors, heights, 1e-3, meter())
    assert weights[3] < 0.1 < np.delete(weights, 3).min()
    assert np.abs(np.delete(straight - vectors, 3, axis=0)).max() < 2e-4


def test_few_stars_leave_more_doubt(rng: np.random.Generator) -> None:
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
