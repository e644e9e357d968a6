import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.processing import transitions
from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches

from ..harness import Harness
from ..sky import Sky, attitude_of, error_deg, take

DARK = np.zeros((512, 1024), np.uint8)
LOST, ASSISTED, TRACKING = MatchMode.LOST_IN_SPACE, MatchMode.ASSISTED, MatchMode.TRACKING


@pytest.fixture
def tracking(catalogue: StarCatalogue) -> Harness:
    """The program that may use what it knows."""
    unit = Harness(catalogue, CubeStarSwitches.of("extended"))
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    return unit


@pytest.fixture
def unsure(tracking: Harness, pose: Rotation, monkeypatch: pytest.MonkeyPatch) -> Harness:
    """After a fix; no fix counts as sure any more."""
    monkeypatch.setattr(transitions, "SURE", 0.0)
    seen(tracking, pose)
    return tracking


def seen(unit: Harness, pose: Rotation | None, wait_s: float = 0.0) -> tuple[MatchMode, Reason]:
    """Search that a picture taken after ``wait_s`` was identified by, and what came of it."""
    unit.run(until_us=unit.now_us + round(1e6 * wait_s))
    unit.picture = two_stars() if pose is None else take(unit.catalogue, pose).picture
    unit.command("CaptureAndProcess")
    quality = unit.telemetry("Quality")
    assert quality["Valid"] == (quality["Reason"] == Reason.SOLVED)
    assert quality["Valid"] == unit.telemetry("AttitudeQuaternion")["Valid"]
    return unit.program.commands.processing.results.mode, Reason(quality["Reason"])


def two_stars() -> np.ndarray:
    picture = DARK.copy()
    picture[100:104, 100:104] = picture[300:304, 700:704] = 80
    return picture


def mode_flag(unit: Harness) -> MatchMode:
    return MatchMode(unit.telemetry("LoopStatus")["ModeFlag"])


def turned(pose: Rotation, degrees: float) -> Rotation:
    return Rotation.from_euler("x", degrees, degrees=True) * pose


def hint(unit: Harness, pose: Rotation) -> None:
    x, y, z = pose.inv().as_matrix()[:, 2]
    unit.command(
        "setTrackingMode",
        RightAscension=np.arctan2(y, x),
        Declination=np.arctan2(z, np.hypot(x, y)),
    )


def test_mode_steps_up_after_a_fix_and_back_down(tracking: Harness, pose: Rotation) -> None:
    assert seen(tracking, pose) == (LOST, Reason.SOLVED)
    assert mode_flag(tracking) is TRACKING
    assert seen(tracking, turned(pose, 0.2)) == (TRACKING, Reason.SOLVED)
    assert seen(tracking, None)[0] is TRACKING
    assert mode_flag(tracking) is ASSISTED
    assert seen(tracking, None)[0] is ASSISTED
    assert mode_flag(tracking) is ASSISTED
    assert seen(tracking, turned(pose, 1.5)) == (ASSISTED, Reason.SOLVED)
    assert mode_flag(tracking) is TRACKING


@pytest.mark.parametrize("failures", [0, 1])
def test_reference_attitude_expires_when_the_body_may_have_left_the_cone(
    tracking: Harness, pose: Rotation, failures: int
) -> None:
    seen(tracking, pose)
    for _ in range(failures):
        seen(tracking, None)
    assert seen(tracking, turned(pose, 4.5), wait_s=5.0) == (LOST, Reason.SOLVED)


def test_hint_is_used_for_one_image_only(tracking: Harness, pose: Rotation) -> None:
    seen(tracking, pose)
    elsewhere = turned(pose, 90)
    hint(tracking, turned(elsewhere, 3))
    assert seen(tracking, elsewhere) == (ASSISTED, Reason.SOLVED)
    hint(tracking, pose)
    assert seen(tracking, elsewhere)[0] is ASSISTED
    assert seen(tracking, elsewhere) == (LOST, Reason.SOLVED)


def test_contradicting_fix_needs_a_second_one(
    tracking: Harness, pose: Rotation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transitions, "SURE", 0.0)  # nothing is
    seen(tracking, pose)
    before = tracking.telemetry("AttitudeQuaternion")
    elsewhere = turned(pose, 60)
    for failure in (TRACKING, ASSISTED):
        assert seen(tracking, None)[0] is failure
    tracking.run(until_us=tracking.now_us + 5_000_000)
    assert seen(tracking, elsewhere) == (LOST, Reason.CONTRADICTION)
    assert tracking.telemetry("AttitudeQuaternion") == before | {"Valid": False}
    assert mode_flag(tracking) is LOST
    values = tracking.telemetry("Quality")
    assert values["SigmaX"] == pytest.approx(np.pi)
    assert seen(tracking, elsewhere) == (LOST, Reason.SOLVED)
    assert error_deg(attitude_of(tracking.telemetry("AttitudeQuaternion")), elsewhere) < 0.02
    assert seen(tracking, elsewhere) == (TRACKING, Reason.SOLVED)


def test_another_contradiction_replaces_the_candidate(unsure: Harness, pose: Rotation) -> None:
    for pose_after in (turned(pose, 60), turned(pose, -70)):
        assert seen(unsure, pose_after, wait_s=5.0) == (LOST, Reason.CONTRADICTION)
    assert seen(unsure, turned(pose, 2)) == (LOST, Reason.SOLVED)  # the base was right
    assert unsure.program.state.candidate is None


def test_contradicting_fix_with_low_false_alarm_needs_no_confirmation(
    tracking: Harness, pose: Rotation
) -> None:
    seen(tracking, pose)
    assert seen(tracking, turned(pose, 60), wait_s=5.0) == (LOST, Reason.SOLVED)
    assert tracking.telemetry("Quality")["LogFalseAlarm"] < np.log10(transitions.SURE)


def test_old_reference_attitude_cannot_contradict_after_half_a_turn(
    unsure: Harness, pose: Rotation
) -> None:
    assert seen(unsure, turned(pose, 170), wait_s=181.0) == (LOST, Reason.SOLVED)
    assert "IDModeError" in unsure.flags()


def test_reference_attitude_keeps_its_age_across_a_reset_on_day_50(
    tracking: Harness, pose: Rotation
) -> None:
    """In flash a picture's time has 32 bits, in ms."""
    tracking.run(until_us=1000 << 32)
    seen(tracking, pose, wait_s=1.0)
    tracking.command("MCUReset")
    assert seen(tracking, turned(pose, 0.2)) == (TRACKING, Reason.SOLVED)


def test_commanded_lost_in_space_solves_each_image_independently(
    unsure: Harness, pose: Rotation
) -> None:
    unsure.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    for degrees in (60, -50, 10):
        assert seen(unsure, turned(pose, degrees)) == (LOST, Reason.SOLVED)
    unsure.command("setIDMode", IdMode=IdMode.TRACKING)
    assert seen(unsure, turned(pose, 10.2)) == (TRACKING, Reason.SOLVED)


def test_power_cycle_forgets_the_tracking_history(unsure: Harness, pose: Rotation) -> None:
    unsure.power_on()  # the attitude is in flash
    unsure.command("setIDMode", IdMode=IdMode.TRACKING)
    assert seen(unsure, turned(pose, 60)) == (LOST, Reason.SOLVED)


def test_candidate_and_quality_survive_a_reset(unsure: Harness, pose: Rotation, sky: Sky) -> None:
    seen(unsure, turned(pose, 60), wait_s=5.0)
    quality, candidate = unsure.telemetry("Quality"), unsure.program.state.candidate
    unsure.command("MCUReset")
    after = unsure.program.state.candidate
    assert candidate is not None
    assert after is not None
    assert after.pack() == candidate.pack()
    assert unsure.telemetry("Quality") == quality


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_last_attitude_serves_as_hint_where_following_is_assisted(
    catalogue: StarCatalogue, pose: Rotation, profile: str
) -> None:
    """A turn by 1 deg, beyond the reach of tracking."""
    found = {}
    for following in ("tracking", "assisted"):
        unit = Harness(catalogue, CubeStarSwitches.of(profile, f"following={following}"))
        unit.command("setIDMode", IdMode=IdMode.TRACKING)
        for degrees in (0.0, 0.5):
            unit.run(until_us=unit.now_us + 1_000_000)
            unit.picture = take(catalogue, turned(pose, degrees)).picture
            unit.command("CaptureAndProcess")
        found[following] = (
            unit.program.commands.processing.results.mode,
            unit.telemetry("AttitudeQuaternion")["Valid"],
        )
    assert found["tracking"][0] is TRACKING
    assert found["assisted"] == (ASSISTED, 1)
    if profile == "published":
        assert not found["tracking"][1]
