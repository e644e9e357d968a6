import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult, ResetTarget
from tests.system.cubesense.conftest import NADIR_DEG, check_right

from .bench import TIMED_OUT, Sense

X, Y = 20, 100


@pytest.mark.parametrize(("kind", "moved"), [("clock-lost", 1), ("clock-extra", -1)])
@pytest.mark.fault
def test_wrong_pixel_clock_shifts_the_rest_of_a_line(quiet: Sense, kind: str, moved: int) -> None:
    clean = quiet.picture()
    check_right(quiet.measure_with(kind, row=Y, column=X))
    line, before = quiet.picture()[Y], clean[Y]
    first, second = (line, before) if moved > 0 else (before, line)
    np.testing.assert_array_equal(first[X + 1 : -1], second[X + 2 :])
    np.testing.assert_array_equal(line[:X], before[:X])
    np.testing.assert_array_equal(np.delete(quiet.picture(), Y, 0), np.delete(clean, Y, 0))
    assert quiet.host_pixel(300, Y) == line[300]
    assert not quiet.board.engine.violations


@pytest.mark.parametrize(
    ("kind", "place", "value"),
    [
        ("pixel-hot", {"x": 10, "y": 10}, 255),  # in the dark
        ("pixel-dead", {"x": 320, "y": 300}, 0),  # on the Earth
        ("column-defect", {"x": 300}, 255),
    ],
)
@pytest.mark.fault
def test_bad_pixels_do_not_disturb_the_fit(
    quiet: Sense, kind: str, place: dict[str, int], value: int
) -> None:
    expected = quiet.picture()
    x, y = place["x"], place.get("y", slice(None))
    assert np.abs(expected[y, x].astype(int) - value).max() > 100
    check_right(quiet.measure_with(kind, **place))
    expected[y, x] = value
    np.testing.assert_array_equal(quiet.picture(), expected)
    assert quiet.host_pixel(x, place.get("y", Y)) == value


@pytest.mark.fault("pixel-hot")
def test_three_hot_pixels_in_a_row_are_taken_for_the_sun(sense: Sense) -> None:
    sense.inject("pixel-hot", target="sun", x=10, y=10)
    sense.check(Camera.SUN)
    assert sense.picture(Camera.SUN)[10, 10] == 255
    for x in (11, 12):
        sense.inject("pixel-hot", target="sun", x=x, y=10)
    sense.measure(Camera.SUN)
    first = sense.device.details(Camera.SUN)
    assert (first["FirstX"], first["FirstY"]) == (10, 10)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.fault("blooming")
def test_blooming_gives_a_bad_fit(quiet: Sense) -> None:
    clean = quiet.picture()
    assert quiet.measure_with("blooming", threshold=150, length=20).detect is DetectResult.BAD_FIT
    expected = clean.copy()
    for y, x in np.argwhere(clean >= 150):
        expected[max(0, y - 20) : y + 21, x] = 255
    np.testing.assert_array_equal(quiet.picture(), expected)
    quiet.check()


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("kind", ["line-missing", "camera-dead"])
@pytest.mark.fault
def test_camera_without_frames_times_out_and_recovers(
    sense: Sense, camera: Camera, kind: str
) -> None:
    sense.check(camera)
    sense.inject(kind, target=HALVES[camera])
    for _ in range(2):
        assert sense.outcome(camera) == TIMED_OUT
        sense.check(Camera(1 - camera))
    silent = sense.board.cameras[camera].segment_at(sense.board.kernel.now) is None
    assert silent is (kind == "camera-dead")
    sense.faults.clear()
    sense.check(camera)


@pytest.mark.fault("camera-dead")
def test_camera_restarts_with_its_reset_exposure(sense: Sense) -> None:
    sense.check()
    usual = sense.picture().mean()
    sense.inject("camera-dead", target="nadir", for_s=0.05)
    sense.client.pause(0.1)
    for _ in range(2):
        found = sense.measure()
        assert found.detect is DetectResult.SUCCESS
        assert abs(found.beta_deg - NADIR_DEG[1]) > 0.1
        assert sense.picture().mean() > 1.3 * usual
    sense.device.reset(ResetTarget.CAMERAS)
    sense.client.pause(0.3)
    sense.check()
    assert sense.picture().mean() == pytest.approx(usual, rel=0.02)
