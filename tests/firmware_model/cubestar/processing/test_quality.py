"""Telemetry Quality: why there is no attitude, and how good one is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    PictureStatistics,
    SearchEnd,
)
from cubestack.firmware_model.cubestar.processing.estimate import reason_of
from cubestack.firmware_model.cubestar.state import UNRATED
from cubestack.firmware_model.interface.cubestar import Reason
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.star_tracker.search import MatchOutcome

from ..harness import Harness
from ..sky import Sky, attitude_of, draw, take

CLEAR = PictureStatistics(
    background=5.0,
    background_range=2.0,
    noise=0.5,
    saturated=5e-5,
    spikes=20,
    large=0,
    elongated=0,
    aligned=0.0,
    streak_px=0.0,
    spot_px=1.2,
)


@pytest.fixture
def extended(catalogue: StarCatalogue) -> Harness:
    return Harness(catalogue, CubeStarSwitches.of("extended"))


def quality(unit: Harness, picture: np.ndarray) -> dict[str, float]:
    unit.picture = picture
    unit.command("CaptureAndProcess")
    return unit.telemetry("Quality")


def detection(stars: int, picture: PictureStatistics | None) -> Detection:
    places, counts = np.zeros((stars, 2), np.float32), np.zeros(stars, np.uint16)
    sizes = counts.astype(np.uint8)
    return Detection(places, sizes, counts, 0, 0, 0, SearchEnd.COMPLETE, statistics=picture)


@pytest.mark.parametrize(
    ("measured", "stars", "reason"),
    [
        ({}, 5, Reason.UNCONFIRMED),
        ({"saturated": 0.01}, 5, Reason.SATURATED),
        ({"saturated": 0.01}, 40, Reason.UNCONFIRMED),
        ({"saturated": 0.31}, 40, Reason.SATURATED),
        ({"background_range": 30.0}, 5, Reason.STRAY_LIGHT),
        ({"background_range": 30.0}, 40, Reason.UNCONFIRMED),
        ({"background": 120.0}, 19, Reason.STRAY_LIGHT),
        ({"background": 120.0}, 20, Reason.UNCONFIRMED),
        ({"background": 40.0}, 5, Reason.UNCONFIRMED),
        ({"background": 40.5}, 5, Reason.STRAY_LIGHT),
        ({"background_range": 30.0, "spikes": 50_000}, 5, Reason.STRAY_LIGHT),
        ({"spikes": 50_000}, 40, Reason.RADIATION),
        ({"spikes": 15_000}, 5, Reason.UNCONFIRMED),
        ({"elongated": 6, "aligned": 0.9}, 40, Reason.SMEAR),
        ({"elongated": 2, "aligned": 0.9}, 40, Reason.UNCONFIRMED),
    ],
)
def test_disturbance_is_the_reason_where_it_explains_the_failure(
    measured: dict[str, float], stars: int, reason: Reason
) -> None:
    picture = replace(CLEAR, **measured)  # type: ignore[arg-type]
    assert reason_of(detection(stars, picture), MatchOutcome.UNCONFIRMED) is reason


@pytest.mark.parametrize("outcome", [o for o in MatchOutcome if o is not MatchOutcome.IDENTIFIED])
def test_each_failure_has_a_reason(outcome: MatchOutcome) -> None:
    said = reason_of(detection(5, CLEAR), outcome)
    assert said not in (Reason.NOT_RATED, Reason.SOLVED)
    assert reason_of(detection(5, None), outcome) is reason_of(None, outcome) is said


@pytest.mark.parametrize("profile", ["published"])
def test_published_profile_reports_no_quality(unit: Harness, sky: Sky) -> None:
    assert unit.telemetry("Quality") == pytest.approx(UNRATED, rel=1e-6)
    assert quality(unit, sky.picture) == pytest.approx(UNRATED, rel=1e-6)


def test_failed_solutions_report_a_reason(
    extended: Harness, catalogue: StarCatalogue, pose: Rotation
) -> None:
    values = quality(extended, np.zeros((512, 1024), np.uint8))
    assert (values["Valid"], values["Reason"]) == (False, Reason.TOO_FEW_STARS)
    assert [values[f"Sigma{axis}"] for axis in "XYZ"] == pytest.approx([np.pi] * 3)
    mirrored = draw(catalogue.vectors * np.array([1, 1, -1], np.float32), pose)
    assert not quality(extended, mirrored.picture)["Valid"]
    extended.frame_us = None
    assert quality(extended, mirrored.picture)["Reason"] == Reason.NO_PICTURE


def test_attitude_errors_match_the_reported_sigma(
    extended: Harness, catalogue: StarCatalogue
) -> None:
    ratios = []
    for true in Rotation.random(40, rng=np.random.default_rng(11)):
        values = quality(extended, take(catalogue, true).picture)
        if not values["Valid"]:
            continue
        assert values["Matched"] <= values["Expected"]
        assert values["LogFalseAlarm"] <= -5
        assert values["Scale"] == pytest.approx(1, abs=2e-3)
        measured = attitude_of(extended.telemetry("AttitudeQuaternion"))
        error = (measured * true.inv()).as_rotvec()
        ratios.append(error / [values[f"Sigma{axis}"] for axis in "XYZ"])
    assert len(ratios) > 35
    assert np.mean(np.abs(ratios) < 3) >= 0.99
