"""Telemetry of the attitude and of the latest picture's outcome."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode

from ..bench import Bench
from ..sky import Sky, attitude_of, error_deg, take


@pytest.fixture(params=range(4))
def true(request: pytest.FixtureRequest) -> Rotation:
    return Rotation.random(rng=np.random.default_rng(100 + request.param))


@pytest.fixture
def solved(bench: Bench, true: Rotation) -> Bench:
    bench.picture = take(bench.catalogue, true).picture
    bench.command("CaptureAndProcess")
    assert bench.telemetry("AttitudeQuaternion")["Valid"]
    return bench


def test_the_quaternion_in_both_precisions(solved: Bench, true: Rotation) -> None:
    exact = solved.telemetry("AttitudeQuaternion")
    assert error_deg(attitude_of(exact), true) < 0.01
    for frame in ("Quaternion", "AttitudeData"):
        printed = solved.telemetry(frame)
        for index in range(4):
            assert printed[f"Qbar{index}"] == pytest.approx(exact[f"Q{index}"], abs=0.51e-4)


def test_the_boresight(solved: Bench, true: Rotation) -> None:
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


def test_before_the_first_attitude(bench: Bench) -> None:
    values = bench.telemetry("AttitudeQuaternion")
    assert values == {
        **{"Q0": 0, "Q1": 0, "Q2": 0, "Q3": 1},
        **{"FrameCounter": 0, "ImageTime": 0, "Matched": 0, "Valid": False},
        "Mode": MatchMode.LOST_IN_SPACE,
    }
    assert bench.telemetry("Quaternion") == {"Qbar0": 0, "Qbar1": 0, "Qbar2": 0, "Qbar3": 1}
    assert bench.telemetry("SphereicalCoordinates")["Declination"] == pytest.approx(np.pi / 2)


def test_results_and_performance_count_the_same(bench: Bench, sky: Sky) -> None:
    bench.command("setIDMode", IdMode=IdMode.TRACKING)
    bench.picture = np.maximum(sky.picture, 4)
    bench.picture[480:500, 30:60] = 200
    bench.picture[450, 800:804] = 90
    bench.command("CaptureAndProcess")
    results = bench.telemetry("Results")
    performance = bench.telemetry("PerformanceParameters")
    summary = bench.telemetry("DetectionSummary")
    assert results == {
        "DarkValue": 4,
        "Detected": summary["NumStarsDetected"],
        "Invalid": summary["NumInvalidStars"],
        "Noise": summary["AmountOfNoise"],
        "IDMode": IdMode.TRACKING,
        "ID": bench.telemetry("NumIdStars")["numIdStars"],
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


def outcome(bench: Bench) -> set[str]:
    """Names of the bits of PerformanceParameters that are set."""
    return {
        name for name, value in bench.telemetry("PerformanceParameters").items() if value is True
    }


def test_how_far_a_picture_came(bench: Bench, sky: Sky) -> None:
    assert outcome(bench) == set()
    bench.picture = sky.picture
    captured, detected = {"ImageCaptureSuccess"}, {"ImageCaptureSuccess", "DetectionSuccess"}
    bench.command("CaptureImage")
    assert outcome(bench) == captured
    bench.command("DetectStars")
    assert outcome(bench) == detected
    bench.command("IDStars")
    assert outcome(bench) == detected | {"IdentificationSuccess"}
    bench.command("EstimateAttitude")
    assert outcome(bench) == detected | {"IdentificationSuccess", "AttitudeSuccess"}
    bench.frame_us = None
    bench.command("CaptureAndProcess")
    assert outcome(bench) == set()


def test_processing_that_takes_too_long(bench: Bench) -> None:
    bench.command("CaptureTestPatern", TestPaternType=0)
    bench.command("setDetectionRegion", StepSize=1)
    bench.command("setDetectionThresholds", DetectionThreshold=255, StarThreshold=255)
    bench.command("DetectStars")
    assert bench.telemetry("DetectionTimingTwo")["StarDetectionTime"] < 500
    assert "ProcessingTimeError" not in outcome(bench)
    bench.program.commands._processing.latest_ms["detection"] = 501.0
    assert "ProcessingTimeError" in outcome(bench)


def test_flags_that_performance_repeats(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.command("setDetectionVariables", MaxStars=3)
    bench.command("DetectStars")
    assert "MaxStarsDetected" in outcome(bench)
    assert "CommsError" not in outcome(bench)
    bench.i2c_read(1)
    assert "CommsError" in outcome(bench)
    bench.command("ClearErrorFlags")
    assert not outcome(bench) & {"MaxStarsDetected", "CommsError"}
    bench.uart(b"x")
    assert "CommsError" in outcome(bench)
