"""CubeStar: faults of the camera and of its pixel lines, in the FPGA's memory and for the host."""

import numpy as np
import pytest

from .bench import Bench
from .cubestar_bench import (
    FAILED,
    GOOD,
    ONE_FRAME_MS,
    ROWS,
    STORING_S,
    TWO_FRAMES_MS,
    block,
    capture,
    capture_with,
    stored,
    stored_for_ms,
)

X, Y = 700, 30
BLOCK = (1024 * Y + X) // 128


@pytest.mark.parametrize("kind", ["clock-lost", "clock-extra"])
@pytest.mark.fault
def test_a_wrong_clock_moves_the_rest_of_one_line(star: Bench, good: np.ndarray, kind: str) -> None:
    assert capture_with(star, kind, row=Y, column=X) == GOOD
    expected = good.copy()
    if kind == "clock-lost":
        expected[Y, X:-1] = good[Y, X + 1 :]
        expected[Y, -1] = stored(star)[Y, -1]  # never written
    else:
        expected[Y, X + 1 :] = good[Y, X:-1]
        assert not star.board.engine.violations
    np.testing.assert_array_equal(stored(star), expected)
    np.testing.assert_array_equal(block(star, BLOCK), expected.reshape(-1, 128)[BLOCK])


@pytest.mark.fault("line-missing")
def test_a_line_that_is_missing_in_all_frames_leaves_the_fpga_waiting(star: Bench) -> None:
    assert capture_with(star, "line-missing", row=100) == FAILED
    assert stored_for_ms(star) == pytest.approx(2000, abs=10)
    assert star.device.capture_and_process().name == "CALCULATED"


@pytest.mark.fault("line-missing")
def test_a_line_that_is_missing_in_one_frame_costs_a_second_one(
    star: Bench, good: np.ndarray
) -> None:
    assert capture_with(star, "line-missing", row=100, for_s=0.5) == GOOD
    assert stored_for_ms(star) == pytest.approx(TWO_FRAMES_MS, abs=1)
    assert (stored(star) != good).mean() < 0.1  # the noise of another frame


@pytest.mark.parametrize(("kind", "value"), [("pixel-hot", 255), ("pixel-dead", 0)])
@pytest.mark.fault
def test_a_bad_pixel_is_one_pixel_and_no_star(
    star: Bench, good: np.ndarray, kind: str, value: int
) -> None:
    brightest = divmod(int(good.argmax()), 1024)
    y, x = (Y, X) if kind == "pixel-hot" else brightest
    assert abs(int(good[y, x]) - value) > 50
    assert capture_with(star, kind, x=x, y=y) == GOOD
    expected = good.copy()
    expected[y, x] = value
    np.testing.assert_array_equal(stored(star), expected)
    number, at = divmod(1024 * y + x, 128)
    assert block(star, number)[at] == value
    stars = star.telemetry("DetectionSummary")["NumStarsDetected"]
    capture(star)
    assert star.telemetry("DetectionSummary")["NumStarsDetected"] == stars


@pytest.mark.fault("column-defect")
def test_a_bad_column_is_no_star(star: Bench, good: np.ndarray) -> None:
    assert capture_with(star, "column-defect", x=500, level=200) == GOOD
    expected = good.copy()
    expected[:, 500] = 200
    np.testing.assert_array_equal(stored(star), expected)


@pytest.mark.fault("column-defect")
def test_a_defect_for_a_while_hits_the_lines_of_that_time(star: Bench) -> None:
    star.faults.inject("column-defect", x=3, at_s=STORING_S, for_s=0.01)
    capture(star)
    lines = np.flatnonzero(stored(star)[:, 3] == 255)
    assert 0 < len(lines) < ROWS
    assert np.all(np.diff(lines) == 1)


@pytest.mark.fault("blooming")
def test_blooming_spoils_the_brightest_stars(star: Bench, good: np.ndarray) -> None:
    outcome = capture_with(star, "blooming", threshold=100, length=20)
    assert outcome == ("IDENTIFICATION_FAILED", {"LessThanThreeStarsID"})
    expected = good.copy()
    for y, x in np.argwhere(good >= 100):
        expected[max(0, y - 20) : y + 21, x] = 255
    np.testing.assert_array_equal(stored(star), expected)
    assert capture(star)[0] == "CALCULATED"


@pytest.mark.fault("camera-dead")
def test_a_dead_camera_is_noticed_at_its_control_bus(star: Bench, good: np.ndarray) -> None:
    began_s = star.now_s
    assert capture_with(star, "camera-dead") == ("CAPTURE_FAILED", {"ISSetupError"})
    assert star.now_s - began_s < 0.1
    assert star.board.camera.segment_at(star.board.kernel.now) is not None  # it is back
    assert star.device.capture_and_process().name == "CALCULATED"


@pytest.mark.fault("camera-dead")
def test_a_camera_that_dies_while_storing_is_set_up_again(star: Bench) -> None:
    star.faults.inject("camera-dead", at_s=STORING_S)
    assert capture(star) == ("CAPTURE_FAILED", {"ImageCaptureError", "ISDisableError"})
    assert stored_for_ms(star) == pytest.approx(2000, abs=10)
    assert star.said() == ["no clock, no answer"]
    star.client.command("ClearErrorFlags")
    assert capture(star) == ("CAPTURE_FAILED", {"ISSetupError"})
    star.faults.clear()
    star.client.command("ClearErrorFlags")
    assert capture(star) == GOOD
    assert stored_for_ms(star) == pytest.approx(ONE_FRAME_MS, abs=1)


@pytest.mark.fault("camera-dead")
def test_a_camera_that_was_dead_between_two_pictures_has_its_reset_exposure(star: Bench) -> None:
    assert capture(star) == GOOD
    usual_ms, usual_sum = stored_for_ms(star), brightness(star)
    star.inject("camera-dead", for_s=0.05)
    star.client.pause(0.1)
    for _ in range(2):
        assert capture(star)[1] == set()
        assert stored_for_ms(star) == pytest.approx(88, abs=1)
        assert brightness(star) < 0.9 * usual_sum
    star.client.command("SetFrameRate", FrameRate=8)  # a change sets it up again
    capture(star)
    star.client.command("SetFrameRate", FrameRate=7)
    assert capture(star) == GOOD
    assert stored_for_ms(star) == pytest.approx(usual_ms, abs=10)
    assert brightness(star) == pytest.approx(usual_sum, rel=0.1)


def brightness(star: Bench) -> float:
    """What the host sees of the stars' light: the sum over all of them."""
    return float(sum(found.intensity for found in star.device.stars()))
