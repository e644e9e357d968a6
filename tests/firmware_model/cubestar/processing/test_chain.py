"""From picture to attitude: steps, mode flag, failures."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode, TaskStatus

from ..harness import Harness
from ..sky import Sky, attitude_of, error_deg, take


def mode_flag(unit: Harness) -> MatchMode:
    return MatchMode(unit.telemetry("LoopStatus")["ModeFlag"])


def process(unit: Harness, picture: np.ndarray) -> dict[str, float]:
    unit.command("ClearErrorFlags")
    unit.picture = picture
    unit.command("CaptureAndProcess")
    return unit.telemetry("AttitudeQuaternion")


def hint(unit: Harness, attitude: Rotation) -> None:
    """A rough boresight, 3 deg off."""
    boresight = attitude.inv().as_matrix()[:, 2]
    declination = np.arcsin(boresight[2])
    off = np.deg2rad(3) / np.cos(declination)
    right_ascension = np.arctan2(boresight[1], boresight[0]) + off
    unit.command("setTrackingMode", RightAscension=right_ascension, Declination=declination)


def turned(pose: Rotation, degrees: float) -> Rotation:
    return Rotation.from_euler("x", degrees, degrees=True) * pose


@pytest.fixture
def tracking(unit: Harness) -> Harness:
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    return unit


DARK = np.zeros((512, 1024), np.uint8)


@pytest.mark.parametrize("seed", range(5))
def test_attitude_from_an_image_is_within_0_005_deg(unit: Harness, seed: int) -> None:
    true = Rotation.random(rng=np.random.default_rng(seed))
    sky = take(unit.catalogue, true)
    values = process(unit, sky.picture)
    assert unit.status() is TaskStatus.CALCULATED
    assert values["Valid"]
    assert values["Mode"] == MatchMode.LOST_IN_SPACE
    assert error_deg(attitude_of(values), true) < 0.005
    assert values["Matched"] == unit.telemetry("NumIdStars")["numIdStars"] >= 4


def test_attitude_time_is_that_of_the_image_of_its_stars(lit: Harness) -> None:
    lit.command("CaptureImage", "DetectStars", "IDStars")
    at_ms = lit.now_us / 1000
    lit.command("CaptureImage", "EstimateAttitude")
    values = lit.telemetry("AttitudeQuaternion")
    assert values["FrameCounter"] == 1
    assert values["ImageTime"] < at_ms


def test_quest_weights_follow_the_confirmation(
    unit: Harness, monkeypatch: pytest.MonkeyPatch, pose: Rotation
) -> None:
    given: list[np.ndarray] = []

    def weigh(*arguments: np.ndarray, rotated: bool) -> np.ndarray:
        assert rotated
        given.extend(arguments[:3])
        return np.array([0, 0, 0, 1], np.float32)

    sky = take(unit.catalogue, pose)
    monkeypatch.setattr("cubestack.firmware_model.cubestar.processing.estimate.quest", weigh)
    process(unit, sky.picture)
    details = [unit.telemetry("IDStarsDetails") for _ in sky.stars]
    measured, inertial, weights = given
    assert list(weights) == [values["ValidationVotes"] for values in details]
    assert pose.apply(inertial) == pytest.approx(measured, abs=1e-3)


def test_a_failure_leaves_the_last_attitude_but_not_its_validity(unit: Harness, sky: Sky) -> None:
    good = process(unit, sky.picture)
    failed = process(unit, DARK)
    assert failed == good | {"Valid": False}
    assert not unit.telemetry("PerformanceParameters")["AttitudeSuccess"]


def test_identifying_again_invalidates_the_attitude(unit: Harness, sky: Sky) -> None:
    process(unit, sky.picture)
    unit.command("IDStars")
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]
    unit.command("EstimateAttitude")
    assert unit.telemetry("AttitudeQuaternion")["Valid"]


@pytest.mark.parametrize(
    ("name", "failed", "flag"),
    [
        ("DetectStars", TaskStatus.DETECTION_FAILED, "StatusError"),
        ("IDStars", TaskStatus.IDENTIFICATION_FAILED, "StatusError"),
        ("SelectBestStars", TaskStatus.BEST_STARS_FAILED, "StatusError"),
        ("EstimateAttitude", TaskStatus.CALCULATION_FAILED, "QuestindexError"),
        ("ProcessImage", TaskStatus.DETECTION_FAILED, "StatusError"),
    ],
)
def test_processing_step_without_its_input_fails_with_its_flag(
    unit: Harness, name: str, failed: TaskStatus, flag: str
) -> None:
    unit.command(name)
    assert unit.status() is failed
    assert unit.flags() == {flag}


def test_too_few_stars_yield_no_attitude(unit: Harness, pose: Rotation) -> None:
    process(unit, DARK)
    assert unit.status() is TaskStatus.DETECTION_FAILED
    assert unit.flags() == {"LessThanThreeStarsDetected"}
    process(unit, take(unit.catalogue, pose, most=2).picture)
    assert unit.status() is TaskStatus.IDENTIFICATION_FAILED
    assert unit.flags() == {"LessThanThreeStarsDetected"}
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 2


def test_failed_attitude_estimation_sets_status_and_flag(
    unit: Harness, monkeypatch: pytest.MonkeyPatch, sky: Sky
) -> None:
    def refuse(*_arguments: object, **_how: object) -> None:
        raise AttitudeError("the vectors all point the same way")

    monkeypatch.setattr("cubestack.firmware_model.cubestar.processing.estimate.quest", refuse)
    process(unit, sky.picture)
    assert unit.status() is TaskStatus.CALCULATION_FAILED
    assert unit.flags() == {"QuestindexError"}
    assert mode_flag(unit) is MatchMode.LOST_IN_SPACE
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]


@pytest.mark.parametrize("profile", ["extended"])
def test_commanded_lost_in_space_does_not_change_mode(unit: Harness, sky: Sky) -> None:
    for _ in range(2):
        assert process(unit, sky.picture)["Mode"] == MatchMode.LOST_IN_SPACE
        assert unit.flags() == set()
        assert mode_flag(unit) is MatchMode.TRACKING  # the firmware's own flag


@pytest.mark.parametrize("profile", ["extended"])
def test_tracking_without_attitude_and_hint_starts_lost(tracking: Harness, sky: Sky) -> None:
    assert process(tracking, sky.picture)["Mode"] == MatchMode.LOST_IN_SPACE
    assert tracking.flags() == {"IDModeError"}
    assert process(tracking, sky.picture)["Mode"] == MatchMode.TRACKING
    assert tracking.flags() == set()


def test_hint_leads_to_assisted_mode_then_tracking(
    tracking: Harness, sky: Sky, pose: Rotation
) -> None:
    hint(tracking, pose)
    assert mode_flag(tracking) is MatchMode.ASSISTED
    assert process(tracking, sky.picture)["Mode"] == MatchMode.ASSISTED
    assert tracking.flags() == set()
    assert process(tracking, sky.picture)["Mode"] == MatchMode.TRACKING


@pytest.mark.parametrize("profile", ["extended"])
def test_wrong_hint_falls_back_to_lost_in_space(
    tracking: Harness, sky: Sky, pose: Rotation
) -> None:
    hint(tracking, turned(pose, 150))
    assert not process(tracking, sky.picture)["Valid"]
    assert "IDModeError" not in tracking.flags()
    assert mode_flag(tracking) is MatchMode.LOST_IN_SPACE
    values = process(tracking, sky.picture)
    assert (values["Valid"], values["Mode"]) == (True, MatchMode.LOST_IN_SPACE)


def test_a_new_hint_replaces_the_attitude(tracking: Harness, sky: Sky, pose: Rotation) -> None:
    process(tracking, sky.picture)
    elsewhere = turned(pose, 90)
    hint(tracking, elsewhere)
    values = process(tracking, take(tracking.catalogue, elsewhere).picture)
    assert (values["Valid"], values["Mode"]) == (True, MatchMode.ASSISTED)
    assert error_deg(attitude_of(values), elsewhere) < 0.01


@pytest.mark.parametrize("profile", ["extended"])
def test_hint_is_discarded_after_the_first_fix(tracking: Harness, sky: Sky, pose: Rotation) -> None:
    hint(tracking, pose)
    process(tracking, sky.picture)
    nearby = turned(pose, 2)  # too far to track
    assert not process(tracking, take(tracking.catalogue, nearby).picture)["Valid"]
    values = process(tracking, take(tracking.catalogue, nearby).picture)
    assert (values["Valid"], values["Mode"]) == (True, MatchMode.ASSISTED)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize(("degrees", "kept"), [(0.1333, True), (0.29, True), (0.35, False)])
def test_tracking_follows_up_to_its_rate_limit(
    tracking: Harness, sky: Sky, pose: Rotation, degrees: float, kept: bool
) -> None:
    process(tracking, sky.picture)
    moved = turned(pose, degrees)
    values = process(tracking, take(tracking.catalogue, moved).picture)
    assert values["Valid"] == kept
    if kept:
        assert values["Mode"] == MatchMode.TRACKING
        assert error_deg(attitude_of(values), moved) < 0.005
        assert tracking.flags() == set()
    else:
        assert "RateExceeded" in tracking.flags()
        assert mode_flag(tracking) is MatchMode.ASSISTED


def test_tracking_needs_two_stars(tracking: Harness, sky: Sky, pose: Rotation) -> None:
    process(tracking, sky.picture)
    values = process(tracking, take(tracking.catalogue, pose, most=2).picture)
    assert (values["Valid"], values["Matched"]) == (True, 2)
    assert error_deg(attitude_of(values), pose) < 0.05


def test_too_few_stars_do_not_raise_a_rate_flag(
    tracking: Harness, sky: Sky, pose: Rotation
) -> None:
    process(tracking, sky.picture)
    process(tracking, take(tracking.catalogue, pose, most=1).picture)
    assert tracking.flags() == {"LessThanThreeStarsDetected"}


def test_the_mode_flag_is_written_to_flash_when_it_changes(tracking: Harness, sky: Sky) -> None:
    for _ in range(3):
        process(tracking, sky.picture)
    assert tracking.flash.writes == {"mode": 1, "attitude": 3}
    tracking.power_on()
    assert mode_flag(tracking) is MatchMode.TRACKING


def test_tracking_mode_without_an_attitude_falls_back_to_lost_in_space(
    tracking: Harness, sky: Sky, pose: Rotation
) -> None:
    hint(tracking, pose)
    tracking.power_on()  # the flag is in flash, the hint is gone
    tracking.command("setIDMode", IdMode=IdMode.TRACKING)
    assert mode_flag(tracking) is MatchMode.ASSISTED
    assert process(tracking, sky.picture)["Mode"] == MatchMode.LOST_IN_SPACE
    assert tracking.flags() == {"IDModeError"}


def test_phase_times_equal_the_charged_cycles(lit: Harness) -> None:
    lit.command("CaptureImage")
    start_us = lit.now_us
    lit.command("DetectStars")
    detect_us = lit.now_us - start_us
    lit.command("IDStars", "SelectBestStars", "EstimateAttitude")
    assert lit.telemetry("PhaseTimes")["Detect"] == pytest.approx(detect_us, abs=100)
    parts = lit.telemetry("DetectionTimingOne")
    assert parts["MaxStarSearchTime"] > 10
    whole = lit.telemetry("DetectionTimingTwo")
    assert whole["StarDetectionTime"] == whole["MaxStarDetectionTime"]
    assert sum(parts.values()) == pytest.approx(whole["StarDetectionTime"], abs=2.5)
    assert lit.telemetry("TimingSummary")["DetectionTime"] == whole["StarDetectionTime"]


def test_longest_detection_time_is_kept(lit: Harness) -> None:
    lit.command("CaptureImage", "DetectStars")
    lit.command("setDetectionRegion", Yend=40)
    lit.command("DetectStars")
    times = lit.telemetry("DetectionTimingTwo")
    assert 0 < times["StarDetectionTime"] < times["MaxStarDetectionTime"]


def test_phase_times_equal_their_charged_cycles(lit: Harness) -> None:
    lit.command("CaptureAndProcess")
    processing = lit.program.commands.processing
    measured = lit.meter.phases.keys() & processing.latest_ms.keys()
    assert {"distances", "verification"} <= measured
    for phase in measured:
        spent_ms = 1000 * lit.meter.phases[phase] / lit.meter.table.clock_hz
        assert processing.latest_ms[phase] == pytest.approx(spent_ms, abs=0.001)
        assert processing.longest_ms[phase] == processing.latest_ms[phase]
