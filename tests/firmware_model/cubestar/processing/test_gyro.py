"""Telemetry StellarGyro: drawn skies that turn between two images."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.processing.gyro import LONGEST_US, NO_RATE
from cubestack.firmware_model.interface.cubestar.codes import RateOutcome
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches

from ..harness import Harness
from ..sky import draw, take

RATE_DEG_S = np.array([0.12, -0.25, 0.31])


@pytest.fixture(params=["published", "extended"])
def unit(request: pytest.FixtureRequest, catalogue: StarCatalogue) -> Harness:
    return Harness(catalogue, CubeStarSwitches.of(request.param, "gyro=on"))


def image(unit: Harness, pose: Rotation) -> dict[str, float]:
    unit.picture = take(unit.catalogue, pose).picture
    unit.command("CaptureAndProcess")
    return unit.telemetry("StellarGyro")


def later(pose: Rotation, seconds: float) -> Rotation:
    return Rotation.from_rotvec(-RATE_DEG_S * seconds, degrees=True) * pose


def rates(values: dict[str, float]) -> np.ndarray:
    return np.degrees([values[f"Rate{axis}"] for axis in "XYZ"])


def two_images(unit: Harness, pose: Rotation, wait_us: int = 500_000) -> dict[str, float]:
    """Taken with ``RATE_DEG_S``; the drawn ones have no rolling shutter."""
    assert image(unit, pose)["Outcome"] == RateOutcome.NO_EARLIER_IMAGE
    before_us = unit.program.state.earlier.stars_us
    unit.run(until_us=unit.now_us + wait_us)
    unit.command("CaptureImage")
    apart_us = unit.program.state.earlier.image_us - before_us
    assert apart_us > wait_us
    seen = take(unit.catalogue, later(pose, apart_us / 1e6)).picture
    unit.external_ram[: seen.size] = seen.ravel()  # as if captured
    unit.command("ProcessImage")
    values = unit.telemetry("StellarGyro")
    if values["Outcome"] == RateOutcome.MEASURED:
        assert values["Interval"] == apart_us
    return values


def test_rate_is_that_of_the_sky(unit: Harness, pose: Rotation) -> None:
    values = two_images(unit, pose)
    assert values["Outcome"] == RateOutcome.MEASURED
    assert values["Matched"] == values["Compared"] == 9
    # Without a rolling shutter the rows' times are wrong by what a star moves down: 0.3 %.
    assert rates(values) == pytest.approx(RATE_DEG_S, abs=3e-3)
    assert values["LogFalseAlarm"] < -10
    assert 0 < np.degrees(values["SigmaX"]) < np.degrees(values["SigmaZ"]) < 0.02


def test_stars_of_no_catalogue_give_a_rate_without_an_attitude(catalogue: StarCatalogue) -> None:
    unit = Harness(catalogue, CubeStarSwitches.of("extended", "gyro=on"))
    plane = np.array([[-0.2, -0.1, 1], [0.25, 0.05, 1], [0.05, 0.12, 1]])
    stars = plane / np.linalg.norm(plane, axis=1, keepdims=True)
    for turn in (Rotation.identity(), Rotation.from_euler("y", 0.2, degrees=True)):
        unit.picture = draw(stars, turn).picture
        unit.command("CaptureAndProcess")
    values = unit.telemetry("StellarGyro")
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]
    assert values["Outcome"] == RateOutcome.MEASURED
    expected = [0, -0.2 * 1e6 / values["Interval"], 0]
    assert rates(values) == pytest.approx(expected, abs=0.02)


def test_off_measures_and_charges_nothing(catalogue: StarCatalogue, pose: Rotation) -> None:
    counts = []
    for switches in ("gyro=off", ""):
        unit = Harness(catalogue, CubeStarSwitches.of("published", switches))
        assert image(unit, pose) == image(unit, pose) == NO_RATE
        counts.append((unit.now_us, dict(unit.meter.counts)))
    assert counts[0] == counts[1]
    assert "gyro" not in unit.meter.phases


def test_stars_of_the_image_before_survive_the_reset_of_the_loop(
    unit: Harness, pose: Rotation
) -> None:
    unit.picture = take(unit.catalogue, pose).picture
    start_us = unit.start_loop(0.1)
    found = []
    for turn in range(4):
        unit.run(until_us=start_us + turn * 1_000_000 + 950_000)
        found.append(unit.telemetry("StellarGyro"))
    assert [one["Outcome"] for one in found[2:]] == [RateOutcome.MEASURED] * 2
    assert [one["Interval"] for one in found[2:]] == pytest.approx([1_000_000] * 2, abs=5000)
    assert np.abs(rates(found[3])).max() < 1e-3
    assert len(unit.resets) >= 3


def test_same_image_again_has_no_rate(unit: Harness, pose: Rotation) -> None:
    image(unit, pose)
    unit.command("ProcessImage")
    assert unit.telemetry("StellarGyro")["Outcome"] == RateOutcome.NO_EARLIER_IMAGE


def test_uploaded_image_has_no_rate_and_neither_has_the_next(unit: Harness, pose: Rotation) -> None:
    image(unit, pose)
    unit.command("UploadImage")
    unit.command("DetectStars")
    assert unit.telemetry("StellarGyro")["Outcome"] == RateOutcome.UNTIMED
    assert image(unit, pose)["Outcome"] == RateOutcome.NO_EARLIER_IMAGE


def test_image_stored_while_another_was_processed_too_long_has_no_time(
    catalogue: StarCatalogue, pose: Rotation
) -> None:
    unit = Harness(catalogue, CubeStarSwitches.of("extended", "gyro=on"))
    unit.frame_us = 50_000  # processing takes longer
    unit.picture = take(unit.catalogue, pose).picture
    start_us = unit.start_loop(0.1)
    unit.run(until_us=start_us + 2_950_000)
    assert unit.telemetry("StellarGyro")["Outcome"] == RateOutcome.UNTIMED


def test_images_too_far_apart_have_no_rate(unit: Harness, pose: Rotation) -> None:
    image(unit, pose)
    unit.run(until_us=unit.now_us + LONGEST_US)
    assert image(unit, pose)["Outcome"] == RateOutcome.TOO_FAR_APART


def test_dark_image_has_too_few_stars_and_another_sky_does_not_match(
    unit: Harness, pose: Rotation
) -> None:
    image(unit, pose)
    assert image(unit, Rotation.from_euler("x", 20, degrees=True) * pose)["Outcome"] == (
        RateOutcome.UNMATCHED
    )
    unit.picture = np.zeros((512, 1024), np.uint8)
    unit.command("CaptureAndProcess")
    assert unit.telemetry("StellarGyro")["Outcome"] == RateOutcome.TOO_FEW_STARS


def test_reset_telecommand_forgets_the_stars(unit: Harness, pose: Rotation) -> None:
    image(unit, pose)
    unit.command("Reset")
    unit.command("SetSwitch", Switch="GYRO", Value="ON")
    assert image(unit, pose)["Outcome"] == RateOutcome.NO_EARLIER_IMAGE
