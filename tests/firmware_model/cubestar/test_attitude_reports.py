"""Telemetry of the attitude and of the latest picture's outcome."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode

from .harness import Harness
from .sky import Sky, attitude_of, error_deg, take


@pytest.fixture(params=range(4))
def true(request: pytest.FixtureRequest) -> Rotation:
    return Rotation.random(rng=np.random.default_rng(100 + request.param))


@pytest.fixture
def solved(unit: Harness, true: Rotation) -> Harness:
    unit.picture = take(unit.catalogue, true).picture
    unit.command("CaptureAndProcess")
    assert unit.telemetry("AttitudeQuaternion")["Valid"]
    return unit


def test_the_quaternion_in_both_precisions(solved: Harness, true: Rotation) -> None:
    exact = solved.telemetry("AttitudeQuaternion")
    assert error_deg(attitude_of(exact), true) < 0.01
    for frame in ("Quaternion", "AttitudeData"):
        printed = solved.telemetry(frame)
        for index in range(4):
            assert printed[f"Qbar{index}"] == pytest.approx(exact[f"Q{index}"], abs=0.51e-4)


def test_the_boresight(solved: Harness, true: Rotation) -> None:
    x, y, z = true.inv().apply([0, 0, 1])
    values = solved.telemetry("AttitudeData")
    assert [values[f"BSV{axis}"] for axis in "XYZ"] == pytest.approx([x, y, z], abs=3e-4)
    angles = solved.telemetry("SphereicalCoordinates")
    right_ascension, declination = np.arctan2(y, x), np.arcsin(z)
    assert angles["Declination"] == pytest.approx(declination, abs=2e-4)
    assert angles["RightAscension"] * np.cos(declination) == pytest.approx(
        right_ascension * np.cos(declination), abs=2e-4
    )
    assert values["RightAscension"] == pytest.approx(angles["RightAscension"], abs=0.51e-4)
    assert values["Declination"] == pytest.approx(angles["Declination"], abs=0.51e-4)


def test_before_the_first_attitude(unit: Harness) -> None:
    values = unit.telemetry("AttitudeQuaternion")
    assert values == {
        **{"Q0": 0, "Q1": 0, "Q2": 0, "Q3": 1},
        **{"FrameCounter": 0, "ImageTime": 0, "Matched": 0, "Valid": False},
        "Mode": MatchMode.LOST_IN_SPACE,
    }
    assert unit.telemetry("Quaternion") == {"Qbar0": 0, "Qbar1": 0, "Qbar2": 0, "Qbar3": 1}
    assert unit.telemetry("SphereicalCoordinates")["Declination"] == pytest.approx(np.pi / 2)


def test_results_and_performance_count_the_same(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    unit.picture = np.maximum(sky.picture, 4)
    unit.picture[480:500, 30:60] = 200
    unit.picture[450, 800:804] = 90
    unit.command("CaptureAndProcess")
    results = unit.telemetry("Results")
    performance = unit.telemetry("PerformanceParameters")
    summary = unit.telemetry("DetectionSummary")
    assert results == {
        "DarkValue": 4,
        "Detected": summary["NumStarsDetected"],
        "Invalid": summary["NumInvalidStars"],
        "Noise": summary["AmountOfNoise"],
        "IDMode": IdMode.TRACKING,
        "ID": unit.telemetry("NumIdStars")["numIdStars"],
    }
    assert results["Invalid"] > 0
    assert results["Noise"] > 0
    assert results["ID"] == len(sky.stars)
    assert [
        performance[name]
        for name in (
            "ImageDarkValue",
            "NumStarsDetected",
            "InvalidStars",
            "StarImageNoise",
            "Idmode",
            "NumberOfStarsID",
        )
    ] == list(results.values())


def outcome(unit: Harness) -> set[str]:
    """Names of the bits of PerformanceParameters that are set."""
    return {
        name for name, value in unit.telemetry("PerformanceParameters").items() if value is True
    }


def test_how_far_a_picture_came(unit: Harness, sky: Sky) -> None:
    assert outcome(unit) == set()
    unit.picture = sky.picture
    captured, detected = {"ImageCaptureSuccess"}, {"ImageCaptureSuccess", "DetectionSuccess"}
    unit.command("CaptureImage")
    assert outcome(unit) == captured
    unit.command("DetectStars")
    assert outcome(unit) == detected
    unit.command("IDStars")
    assert outcome(unit) == detected | {"IdentificationSuccess"}
    unit.command("EstimateAttitude")
    assert outcome(unit) == detected | {"IdentificationSuccess", "AttitudeSuccess"}
    unit.frame_us = None
    unit.command("CaptureAndProcess")
    assert outcome(unit) == set()


def test_processing_that_takes_too_long(unit: Harness) -> None:
    unit.command("CaptureTestPatern", TestPaternType=0)
    unit.command("setDetectionRegion", StepSize=1)
    unit.command("setDetectionThresholds", DetectionThreshold=255, StarThreshold=255)
    unit.command("DetectStars")
    assert unit.telemetry("DetectionTimingTwo")["StarDetectionTime"] < 500
    assert "ProcessingTimeError" not in outcome(unit)
    unit.program.commands.processing.latest_ms["detection"] = 501.0
    assert "ProcessingTimeError" in outcome(unit)
