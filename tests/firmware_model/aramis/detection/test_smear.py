"""Streaks of known length, drawn by sweeping a spot."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.regions import find_regions
from cubestack.firmware_model.aramis.detection.spots import StarSpots, smear_px, without_tracks
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.pipeline import VERIFIED, detect_locally
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

from ..sky import FIELD, database, meter, picture


def swept(
    length: float, angle_deg: float, light: float, count: int = 12, background: Any = 0
) -> NDArray[np.uint8]:
    """Spots of standard deviation 1.5 px that move by `length`, of `light` grey levels each."""
    rng = np.random.default_rng(3)
    image = rng.normal(6, 1.5, (FIELD.rows, FIELD.columns)) + background
    steps = max(1, round(2 * length))
    along = (np.arange(steps) + 0.5) / steps - 0.5
    y, x = np.mgrid[-80:81, -80:81].astype(float)
    streak = np.zeros_like(x)
    for part in along * length:
        dx, dy = part * np.cos(np.radians(angle_deg)), part * np.sin(np.radians(angle_deg))
        streak += np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / (2 * 1.5**2))
    streak *= light / steps / (2 * np.pi * 1.5**2)
    for number in range(count):
        row, column = 200 + 180 * (number // 4), 300 + 180 * (number % 4)
        image[row - 80 : row + 81, column - 80 : column + 81] += streak
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("angle_deg", [0, 30, 90, 135])
@pytest.mark.parametrize("length", [0.0, 6.0, 20.0])
def test_length_of_bright_streaks(length: float, angle_deg: float) -> None:
    image = swept(length, angle_deg, light=4000, count=4)
    found_px = smear_px(image, find_regions(image > 12), 6)
    assert found_px == pytest.approx(length, abs=1.5)


def found(image: NDArray[np.uint8]) -> StarList:
    return detect_locally(image, FIELD, VERIFIED.detection, meter())


@pytest.mark.parametrize("angle_deg", [0, 40, 90, 160])
@pytest.mark.parametrize("length", [8.0, 20.0, 60.0])
def test_streaks_that_lie_the_same_way_are_motion(length: float, angle_deg: float) -> None:
    stars = found(swept(length, angle_deg, light=200 * length))
    assert stars.smear_px == pytest.approx(length, rel=0.2)
    assert len(stars) == 12


def test_streaks_around_the_boresight_are_motion() -> None:
    places = np.array([[300, 0], [0, 300], [-300, 0], [0, -300], [200, 200]], np.float32)
    spots = long_spots(places + FIELD.centre, np.arctan2(places[:, 1], places[:, 0]) + np.pi / 2)
    kept, smear = without_tracks(spots, FIELD)
    assert (len(kept), smear) == (5, pytest.approx(12))


@pytest.mark.parametrize(("count", "length"), [(3, 12), (2, 0)])
def test_three_parallel_streaks_tell_a_motion_and_two_do_not(count: int, length: float) -> None:
    places = FIELD.centre + np.array([[100, 50], [-200, 80], [30, -250]][:count])
    kept, smear = without_tracks(long_spots(places, np.full(count, 0.7)), FIELD)
    assert (len(kept), smear) == (count if length else 0, pytest.approx(length))


def test_tracks_in_all_directions_are_left_out() -> None:
    rng = np.random.default_rng(1)
    spots = long_spots(FIELD.centre + rng.uniform(-300, 300, (20, 2)), rng.uniform(0, np.pi, 20))
    kept, smear = without_tracks(spots, FIELD)
    assert (len(kept), smear) == (0, 0)


def test_stars_at_rest_are_not_drawn_out() -> None:
    """Nor are noise alone, bright stars in rows and columns, a slope, or a glow."""
    y, x = np.mgrid[: FIELD.rows, : FIELD.columns]
    glow = 30 * np.exp(-((x - 400) ** 2 + (y - 200) ** 2) / (2 * 300.0**2))
    for light, background in ((0, 0), (8000, 0), (0, 0.05 * x), (800, 0.05 * x), (800, glow)):
        stars = found(swept(0, 0, light, background=background))
        assert stars.smear_px == 0
        assert len(stars) == (12 if light else 0)


def test_without_regions_nothing_is_drawn_out() -> None:
    image = np.zeros((FIELD.rows, FIELD.columns), np.uint8)
    assert smear_px(image, find_regions(image > 0), 0) == 0  # type: ignore[arg-type]


def long_spots(places: NDArray[Any], angles: NDArray[Any]) -> StarSpots:
    """Streaks of 12 px."""
    count = len(places)
    ones = np.ones(count, np.float32)
    return StarSpots(
        places.astype(np.float32),
        100 * ones,
        ones,
        12 * ones,
        (angles % np.pi).astype(np.float32),
        20 * ones,
        0,
        0,
    )


def test_smear_is_the_reason_when_there_is_no_attitude() -> None:
    made = picture(np.random.default_rng(1), FIELD)
    few = made.stars.centroids[:2], made.stars.brightness[:2]
    for smear, reason in ((9.0, Reason.SMEAR), (2.0, Reason.TOO_FEW_STARS)):
        found = identify(StarList(*few, smear), FIELD, VERIFIED.profile, database(), meter())
        assert (found.outcome, found.reason) == (MeasurementOutcome.NONE, reason)


def test_a_skewed_picture_is_refused_and_a_smeared_one_is_not() -> None:
    made = picture(np.random.default_rng(2), FIELD).stars
    for skew, outcome in ((1.0, MeasurementOutcome.CONCLUSIVE), (9.0, MeasurementOutcome.NONE)):
        stars = StarList(made.centroids, made.brightness, 20.0, skew)
        found = identify(stars, FIELD, VERIFIED.profile, database(), meter())
        assert found.outcome is outcome
    still = StarList(made.centroids, made.brightness, 2.0, 9.0)
    assert identify(still, FIELD, VERIFIED.profile, database(), meter()).quaternion is not None
