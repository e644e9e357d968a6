from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.attitude import pointing_from_matrix
from cubestack.firmware_model.interface.cubestar import (
    INTERFACE,
    AckError,
    Disc,
    MatchMode,
    RateOutcome,
    Reason,
    TaskStatus,
)
from cubestack.host.clients.cubestar.client import COLUMNS, ROWS, Attitude, CubeStar, Star
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.quaternions import pointing_deg
from cubestack.host.errors import BadAnswerError, CommandRefusedError, StepFailedError


@pytest.fixture
def cubestar(either_client: NodeClient | I2cClient) -> CubeStar:
    return CubeStar(either_client)


@given(st.integers(0, 2**32 - 1))
def test_boresight_is_the_camera_axis_in_the_sky(seed: int) -> None:
    rotation = Rotation.random(rng=np.random.default_rng(seed))
    attitude = Attitude(rotation.as_quat(), True, 5, MatchMode.TRACKING, 1, 0.0)
    expected = rotation.inv().as_matrix() @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(attitude.boresight, expected, atol=1e-12)
    ra, dec = np.deg2rad([attitude.ra_deg, attitude.dec_deg])
    direction = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
    np.testing.assert_allclose(direction, expected, atol=1e-9)
    assert 0.0 <= attitude.ra_deg <= 360.0


@given(st.integers(0, 2**32 - 1))
def test_pointing_matches_the_scenes(seed: int) -> None:
    rotation = Rotation.random(rng=np.random.default_rng(seed))
    expected = pointing_from_matrix(rotation.as_matrix())
    np.testing.assert_allclose(pointing_deg(rotation.as_quat()), expected, atol=1e-6)


def test_latest_returns_a_log_line(cubestar: CubeStar, node: Any) -> None:
    values = {"Q0": 0.0, "Q1": 0.0, "Q2": 0.0, "Q3": 1.0, "ImageTime": 1500, "Matched": 9}
    node.values["AttitudeQuaternion"] = {**values, "Mode": MatchMode.TRACKING, "Valid": 1}
    line = cubestar.latest()
    assert (line["q3"], line["dec_deg"], line["image_time_s"]) == (1.0, 90.0, 1.5)
    assert (line["valid"], line["matched"], line["mode"]) == (True, 9, "TRACKING")
    node.values["AttitudeQuaternion"]["Valid"] = 0
    old = cubestar.latest()
    assert list(old) == list(line)
    assert (old["valid"], old["q3"], old["ra_deg"]) == (False, None, None)


def test_attitude_returns_a_normalised_quaternion_and_its_mode(
    cubestar: CubeStar, node: Any
) -> None:
    quaternion = np.array([0.1, -0.2, 0.3, 0.927361849549570])
    node.values["AttitudeQuaternion"] = {
        **{f"Q{index}": value for index, value in enumerate(quaternion)},
        **{"FrameCounter": 12, "ImageTime": 34_567, "Matched": 9},
        **{"Mode": MatchMode.ASSISTED, "Valid": True},
    }
    attitude = cubestar.attitude()
    np.testing.assert_allclose(attitude.quaternion, quaternion, atol=1e-7)
    assert np.linalg.norm(attitude.quaternion) == pytest.approx(1.0, abs=1e-15)
    assert attitude.mode is MatchMode.ASSISTED
    assert (attitude.valid, attitude.matched, attitude.frame) == (True, 9, 12)
    assert attitude.image_time_s == 34.567
    node.values["AttitudeData"] = {"Qbar0": 0.6, "Qbar3": -0.8}
    np.testing.assert_allclose(cubestar.coarse_quaternion(), [0.6, 0, 0, -0.8], atol=5e-5)


def test_quality_returns_the_covariance(cubestar: CubeStar, node: Any) -> None:
    node.values["Quality"] = {
        **{"SigmaX": 1e-4, "SigmaY": 2e-4, "SigmaZ": 5e-4, "Scale": 1.01, "LogFalseAlarm": -9.0},
        **{"CorrelationXY": 0.5, "CorrelationXZ": -0.25, "CorrelationYZ": 0.0},
        **{"FrameCounter": 12, "Reason": Reason.SOLVED, "Matched": 7, "Expected": 9, "Valid": True},
    }
    quality = cubestar.quality()
    assert (quality.valid, quality.reason, quality.frame) == (True, Reason.SOLVED, 12)
    assert (quality.matched, quality.expected) == (7, 9)
    assert quality.false_alarm == pytest.approx(1e-9)
    np.testing.assert_allclose(quality.sigmas_rad, [1e-4, 2e-4, 5e-4], rtol=1e-6)
    np.testing.assert_allclose(quality.covariance[0], [1e-8, 1e-8, -1.25e-8], rtol=1e-5)
    np.testing.assert_array_equal(quality.covariance, quality.covariance.T)
    node.values["Quality"] |= {"CorrelationXZ": -1.5}
    with pytest.raises(BadAnswerError, match="correlations within 1"):
        cubestar.quality()


def test_body_rate_returns_rates_sigmas_and_outcome(cubestar: CubeStar, node: Any) -> None:
    node.values["StellarGyro"] = {
        **{"FrameCounter": 7, "Outcome": RateOutcome.MEASURED, "Interval": 999_500, "Matched": 8},
        **{"RateX": 0.001, "RateY": -0.002, "RateZ": 0.003},
        **{"SigmaX": 1e-6, "SigmaY": 2e-6, "SigmaZ": 3e-6},
    }
    rate = cubestar.body_rate()
    assert (rate.valid, rate.frame, rate.matched, rate.interval_s) == (True, 7, 8, 0.9995)
    np.testing.assert_allclose(rate.rate_rad_s, [0.001, -0.002, 0.003], rtol=1e-6)
    np.testing.assert_allclose(rate.sigmas_rad_s, [1e-6, 2e-6, 3e-6], rtol=1e-6)
    node.values["StellarGyro"] = {"Outcome": RateOutcome.UNMATCHED}
    assert not cubestar.body_rate().valid


def test_bodies_seen_returns_counts_and_the_disc(cubestar: CubeStar, node: Any) -> None:
    node.values["Bodies"] = {
        **{"FrameCounter": 7, "Listed": 3, "Named": 2, "Used": 1},
        **{"Disc": Disc.CONFIRMED, "DiscApart": 0.003},
    }
    seen = cubestar.bodies_seen()
    assert (seen.listed, seen.named, seen.used, seen.disc) == (3, 2, 1, Disc.CONFIRMED)
    assert seen.disc_apart_rad == pytest.approx(0.003)


@pytest.mark.slow
def test_download_image_reports_progress(cubestar: CubeStar, node: Any) -> None:
    node.memory[:] = np.random.default_rng(5).integers(0, 256, node.memory.size)
    seen: list[tuple[int, int]] = []
    image = cubestar.download_image(lambda done, total: seen.append((done, total)))
    assert (image.shape, image.dtype) == ((ROWS, COLUMNS), np.uint8)
    np.testing.assert_array_equal(image.ravel(), node.memory)
    assert seen == [(number, 4096) for number in range(1, 4097)]


def test_upload_sends_the_lit_blocks_only(cubestar: CubeStar, node: Any) -> None:
    node.memory[:] = 9
    image = np.zeros((ROWS, COLUMNS), np.uint8)
    image[100:103, 200:260] = np.random.default_rng(5).integers(1, 256, (3, 60))
    image[511, 1023] = 1
    seen: list[tuple[int, int]] = []
    cubestar.upload_image(image, lambda done, total: seen.append((done, total)))
    np.testing.assert_array_equal(node.memory, image.ravel())
    assert seen[-1] == (7, 7)  # columns 200 to 259 reach over two blocks of each row


def test_upload_waits_for_a_full_buffer(uart: Any, node: Any) -> None:
    node.refusals.extend([AckError.OK, AckError.BUFFER_FULL])
    CubeStar(NodeClient(uart, INTERFACE)).upload_image(np.ones((ROWS, COLUMNS), np.uint8))
    assert node.memory.all()


def test_upload_reports_missing_blocks(cubestar: CubeStar, node: Any) -> None:
    class Forgetful(dict[str, Any]):
        def __setitem__(self, key: str, value: Any) -> None:
            super().__setitem__(key, 0)

    node.values["UploadStatus"] = Forgetful(BlocksReceived=0)
    image = np.zeros((ROWS, COLUMNS), np.uint8)
    image[:16, 0] = 1
    with pytest.raises(StepFailedError, match="upload: 0 blocks arrived of 16"):
        cubestar.upload_image(image)


@pytest.mark.parametrize("shape", [(512, 1023), (1024, 512), (512, 1024, 1)])
def test_upload_rejects_other_shapes_and_types(cubestar: CubeStar, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"is uint8 \(512, 1024\), not uint8"):
        cubestar.upload_image(np.zeros(shape, np.uint8))
    with pytest.raises(ValueError, match="not float64"):
        cubestar.upload_image(np.zeros((ROWS, COLUMNS)))  # type: ignore[arg-type]


PLACE = ("X_Coordinate", "Y_Coordinate", "X_CorrectedCoordinate", "Y_CorrectedCoordinate")


def star(number: int) -> dict[str, Any]:
    place = {name: 10.0 * factor * number for factor, name in enumerate(PLACE, start=1)}
    return {**place, "StarNumber": number, "Size": 9, "Intensity": 400}


def test_stars_are_ordered_wherever_stepping_starts(cubestar: CubeStar, node: Any) -> None:
    node.values["DetectionSummary"] = {"NumStarsDetected": 4}
    node.values["NumIdStars"] = {"numIdStars": 2}
    node.records["StarPositions"] = [star(number) for number in (2, 3, 0, 1)]
    node.records["HipparcosNumber"] = [
        {"StarNumber": 3, "Hipparcos": 91_262},
        {"StarNumber": 1, "Hipparcos": 113_368},
    ]
    stars = cubestar.stars()
    assert [found.number for found in stars] == [0, 1, 2, 3]
    assert [found.hipparcos for found in stars] == [None, 113_368, None, 91_262]
    assert stars[2] == Star(2, 20.0, 40.0, 60.0, 80.0, 9, 400, None)


def test_stars_survive_a_lost_answer_but_not_a_missing_star(cubestar: CubeStar, node: Any) -> None:
    node.values["DetectionSummary"] = {"NumStarsDetected": 3}
    node.records["StarPositions"] = [star(number) for number in (0, 1, 1, 2)]
    assert [found.number for found in cubestar.stars()] == [0, 1, 2]
    node.records["StarPositions"] = [star(0), star(1)]
    node._steps.clear()
    with pytest.raises(BadAnswerError, match="StarPositions: 2 stars of 3 came in 6 reads"):
        cubestar.stars()


def test_capture_reports_a_failure(cubestar: CubeStar, node: Any) -> None:
    node.values["TaskStatus"] = {"taskStatus": TaskStatus.CAPTURED}
    cubestar.capture()
    node.values["TaskStatus"] = {"taskStatus": TaskStatus.CAPTURE_FAILED}
    with pytest.raises(StepFailedError, match="no image captured: task status CAPTURE_FAILED"):
        cubestar.capture()
    node.values["TaskStatus"] = {"taskStatus": 99}
    with pytest.raises(BadAnswerError, match="unknown status 99"):
        cubestar.capture()


def test_processing_returns_the_task_status(cubestar: CubeStar, node: Any) -> None:
    node.busy = 3
    node.values["TaskStatus"] = {"taskStatus": TaskStatus.IDENTIFICATION_FAILED}
    assert cubestar.capture_and_process() is TaskStatus.IDENTIFICATION_FAILED
    assert cubestar.process_image() is TaskStatus.IDENTIFICATION_FAILED
    assert [name for name, _ in node.log] == ["CaptureAndProcess", "ProcessImage"]


def test_configure_sends_every_setting(cubestar: CubeStar, node: Any) -> None:
    cubestar.configure({"Exposure": {"exposure": 100}, "setIDMargin": {"Margin": 0.002}})
    assert node.log == [("Exposure", {"exposure": 100}), ("setIDMargin", {"Margin": 0.002})]
    with pytest.raises(CommandRefusedError, match="setIDMargin refused: BAD_PARAMETER"):
        cubestar.configure({"setIDMargin": {"Margin": 0.0}})


def test_phase_times_returns_milliseconds_by_phase(cubestar: CubeStar, node: Any) -> None:
    node.values["PhaseTimes"] = {"Idle": 140_000, "Transfer": 404_123, "LoopTotal": 1_000_000}
    known = {"idle": 140.0, "transfer": 404.123, "loop_total": 1000.0}
    names = ["idle", "discard", "capture", "transfer", "detect", "match", "attitude", "loop_total"]
    assert list(cubestar.phase_times().items()) == [(name, known.get(name, 0.0)) for name in names]
