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


def test_attitude_telemetry_has_the_quaternion_in_both_precisions(
    solved: Harness, true: Rotation
) -> None:
    exact = solved.telemetry("AttitudeQuaternion")
    assert error_deg(attitude_of(exact), true) < 0.01
    for frame in ("Quaternion", "AttitudeData"):
        printed = solved.telemetry(frame)
        for index in range(4):
            assert printed[f"Qbar{index}"] == pytest.approx(exact[f"Q{index}"], abs=0.51e-4)


def test_boresight_telemetry_matches_the_attitude(solved: Harness, true: Rotation) -> None:
    x, y, z = true.inv().apply([0, 0, 1])
    values = solved.telemetry("AttitudeData")
    assert [values[f"BSV{axis}"] for axis in "XYZ"] == pytest.approx([x, y, z], abs=3e-4)
    angles = solved.telemetry("SphereicalCoordinates")
    assert angles["Declination"] == pytest.approx(np.arcsin(z), abs=2e-4)
    across = np.hypot(x, y)  # the cosine of the declination
    assert angles["RightAscension"] == pytest.approx(np.arctan2(y, x), abs=2e-4 / across)
    printed = {name: values[name] for name in angles}
    assert printed == pytest.approx(angles, abs=0.51e-4)


def test_attitude_telemetry_before_the_first_fix_is_the_identity(unit: Harness) -> None:
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
        "DarkValue": summary["ImageDarkValue"],
        "Detected": summary["NumStarsDetected"],
        "Invalid": summary["NumInvalidStars"],
        "Noise": summary["AmountOfNoise"],
        "IDMode": IdMode.TRACKING,
        "ID": unit.telemetry("NumIdStars")["numIdStars"],
    }
    assert (results["DarkValue"], results["ID"]) == (4, len(sky.stars))
    assert results["Invalid"] > 0
    assert results["Noise"] > 0
    counts = ("ImageDarkValue", "NumStarsDetected", "InvalidStars", "StarImageNoise")
    names = (*counts, "Idmode", "NumberOfStarsID")
    assert [performance[name] for name in names] == list(results.values())


def outcome(unit: Harness) -> set[str]:
    return {
        name for name, value in unit.telemetry("PerformanceParameters").items() if value is True
    }


def test_performance_counts_the_stage_reached(lit: Harness) -> None:
    reached: set[str] = set()
    assert outcome(lit) == reached
    for name, bit in (
        ("CaptureImage", "ImageCaptureSuccess"),
        ("DetectStars", "DetectionSuccess"),
        ("IDStars", "IdentificationSuccess"),
        ("EstimateAttitude", "AttitudeSuccess"),
    ):
        lit.command(name)
        reached.add(bit)
        assert outcome(lit) == reached
    lit.frame_us = None
    lit.command("CaptureAndProcess")
    assert outcome(lit) == set()


def test_processing_above_500_ms_raises_processing_time_error(unit: Harness) -> None:
    latest_ms = unit.program.commands.processing.latest_ms
    for detection_ms, too_long in ((400.0, set()), (401.0, {"ProcessingTimeError"})):
        latest_ms |= {"detection": detection_ms, "identification": 60.0, "attitude": 40.0}
        assert outcome(unit) == too_long
