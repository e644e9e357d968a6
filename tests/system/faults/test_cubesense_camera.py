"""CubeSense: faults of the cameras and of their pixel lines."""

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    ResetTarget,
)

from .bench import NADIR_DEG, Bench
from .cubesense_bench import (
    FAILED,
    TARGETS,
    check_next,
    check_right,
    host_pixel,
    measure,
    measure_with,
    picture,
)

X, Y = 20, 100


@pytest.mark.parametrize(("kind", "moved"), [("clock-lost", 1), ("clock-extra", -1)])
@pytest.mark.fault
def test_a_wrong_clock_moves_the_rest_of_one_line(quiet: Bench, kind: str, moved: int) -> None:
    clean = picture(quiet)
    check_right(measure_with(quiet, kind, row=Y, column=X))
    line, before = picture(quiet)[Y], clean[Y]
    first, second = (line, before) if moved > 0 else (before, line)
    np.testing.assert_array_equal(first[X + 1 : -1], second[X + 2 :])
    np.testing.assert_array_equal(line[:X], before[:X])
    np.testing.assert_array_equal(np.delete(picture(quiet), Y, 0), np.delete(clean, Y, 0))
    assert host_pixel(quiet, 300, Y) == line[300]
    assert not quiet.board.engine.violations


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("line-missing")
def test_a_line_that_is_missing_in_all_frames_times_out(sense: Bench, camera: Camera) -> None:
    check_right(measure(sense, camera))
    sense.inject("line-missing", target=TARGETS[camera])
    found = measure(sense, camera)
    assert (found.capture, found.detect) == FAILED
    sense.faults.clear()
    check_next(sense, camera)


@pytest.mark.parametrize(("kind", "value"), [("pixel-hot", 255), ("pixel-dead", 0)])
@pytest.mark.fault
def test_a_bad_pixel_is_one_pixel(quiet: Bench, kind: str, value: int) -> None:
    expected = picture(quiet)
    x, y = (10, 10) if kind == "pixel-hot" else (320, 300)  # in the dark, on the Earth
    assert abs(int(expected[y, x]) - value) > 100
    check_right(measure_with(quiet, kind, x=x, y=y))
    expected[y, x] = value
    np.testing.assert_array_equal(picture(quiet), expected)
    assert host_pixel(quiet, x, y) == value


@pytest.mark.fault("pixel-hot")
def test_one_hot_pixel_is_not_taken_for_the_sun_but_three_in_a_row_are(sense: Bench) -> None:
    sense.inject("pixel-hot", target="sun", x=10, y=10)
    check_right(measure(sense, Camera.SUN))
    assert picture(sense, Camera.SUN)[10, 10] == 255
    for x in (11, 12):
        sense.inject("pixel-hot", target="sun", x=x, y=10)
    measure(sense, Camera.SUN)
    first = sense.device.details(Camera.SUN)
    assert (first["FirstX"], first["FirstY"]) == (10, 10)


@pytest.mark.fault("column-defect")
def test_a_bad_column_does_not_fit(quiet: Bench) -> None:
    expected = picture(quiet)
    check_right(measure_with(quiet, "column-defect", x=300))
    expected[:, 300] = 255
    np.testing.assert_array_equal(picture(quiet), expected)
    assert host_pixel(quiet, 300, Y) == 255


@pytest.mark.fault("blooming")
def test_blooming_spoils_the_limb(quiet: Bench) -> None:
    clean = picture(quiet)
    found = measure_with(quiet, "blooming", threshold=150, length=20)
    assert (found.capture, found.detect) == (CaptureResult.STORED_OWN_SRAM, DetectResult.BAD_FIT)
    expected = clean.copy()
    for y, x in np.argwhere(clean >= 150):
        expected[max(0, y - 20) : y + 21, x] = 255
    np.testing.assert_array_equal(picture(quiet), expected)
    check_next(quiet)


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("camera-dead")
def test_a_dead_camera_times_out_and_is_set_up_again(sense: Bench, camera: Camera) -> None:
    check_right(measure(sense, camera))
    sense.inject("camera-dead", target=TARGETS[camera])
    for _ in range(2):
        found = measure(sense, camera)
        assert (found.capture, found.detect) == FAILED
        check_next(sense, Camera(1 - camera))
    assert sense.board.cameras[camera].segment_at(sense.board.kernel.now) is None
    sense.faults.clear()
    check_next(sense, camera)


@pytest.mark.fault("camera-dead")
def test_a_camera_that_was_dead_between_two_pictures_has_its_reset_exposure(sense: Bench) -> None:
    check_right(measure(sense))
    usual = picture(sense).mean()
    sense.inject("camera-dead", target="nadir", for_s=0.05)
    sense.client.pause(0.1)
    for _ in range(2):
        found = measure(sense)
        assert found.detect is DetectResult.SUCCESS
        assert abs(found.beta_deg - NADIR_DEG[1]) > 0.1
        assert picture(sense).mean() > 1.3 * usual
    sense.device.reset(ResetTarget.CAMERAS)
    sense.client.pause(0.3)
    check_next(sense)
    assert picture(sense).mean() == pytest.approx(usual, rel=0.02)
