"""Streaks of known length, drawn by sweeping a spot."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.regions import find_regions
from cubestack.firmware_model.aramis.detection.smear import is_drawn_out, smear_px
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED, explain
from cubestack.firmware_model.aramis.solution import StarList, unsolved
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
    found_px = smear_px(image, find_regions(image > 12, meter()), 6, meter())
    assert found_px == pytest.approx(length, abs=1.5)


@pytest.mark.parametrize("angle_deg", [0, 40, 90, 160])
def test_faint_streaks_show_together(angle_deg: float) -> None:
    """A star that is bright enough at rest has no bright pixel left."""
    image = swept(95, angle_deg, light=800)
    assert np.count_nonzero(image > 12) < 50
    assert is_drawn_out(image, FIELD, meter())


def test_stars_at_rest_are_not_drawn_out() -> None:
    """Nor are noise alone, bright stars in rows and columns, a slope, or a glow."""
    y, x = np.mgrid[: FIELD.rows, : FIELD.columns]
    glow = 30 * np.exp(-((x - 400) ** 2 + (y - 200) ** 2) / (2 * 300.0**2))
    for light, background in ((0, 0), (8000, 0), (0, 0.05 * x), (800, 0.05 * x), (800, glow)):
        assert not is_drawn_out(swept(0, 0, light, background=background), FIELD, meter())


def test_a_picture_without_noise_is_not_drawn_out() -> None:
    for level in (0, 7, 255):
        image = np.full((FIELD.rows, FIELD.columns), level, dtype=np.uint8)
        assert not is_drawn_out(image, FIELD, meter())
    assert smear_px(image, find_regions(image > 255, meter()), 0, meter()) == 0  # type: ignore[arg-type]


def test_streaks_explain_why_there_is_no_attitude() -> None:
    nothing = StarList(np.zeros((0, 2), np.float32), np.zeros(0, np.float32))
    failed = unsolved(Reason.TOO_FEW_STARS, nothing)
    streaks, rest = swept(95, 40, light=800), swept(0, 0, light=800)
    cases = (streaks, VERIFIED), (rest, VERIFIED), (streaks, PUBLISHED)
    reasons = [explain(failed, image, way, meter()).reason for image, way in cases]
    assert reasons == [Reason.SMEAR, Reason.TOO_FEW_STARS, Reason.TOO_FEW_STARS]


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


def test_a_picture_is_compared_in_integers() -> None:
    spent = meter()
    is_drawn_out(swept(95, 40, light=800), FIELD, spent)
    assert spent.counts["i32_mul"] > 1_000_000
    assert sum(count for name, count in spent.counts.items() if name.startswith("f32")) < 1000


@pytest.mark.parametrize("level", [1, 40])
def test_a_level_added_to_all_pixels_changes_nothing(level: int) -> None:
    for image in (swept(95, 40, light=800), swept(0, 0, light=800)):
        lighter = np.minimum(image.astype(int) + level, 255).astype(np.uint8)
        assert is_drawn_out(lighter, FIELD, meter()) == is_drawn_out(image, FIELD, meter())
