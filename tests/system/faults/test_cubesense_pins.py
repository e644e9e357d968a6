from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    Reason,
    ResetTarget,
)
from tests.system.cubesense.conftest import NADIR_DEG, check_right
from tests.tiers import quick

from .bench import TIMED_OUT, Sense, line_s

ACK = {Camera.SUN: "SUNACK", Camera.NADIR: "NADACK"}
ENABLES = {Camera.SUN: "SUNEN", Camera.NADIR: "NADEN"}
PINS = (*ENABLES.values(), "RNW", "EDGE", "SHIFT")

BEFORE = -110  # lines before the frame, before the gap that starts it
SEARCHING_S = {Camera.SUN: 0.0004, Camera.NADIR: 0.035}  # after the command: amid the edge data

STORED = CaptureResult.STORED_OWN_SRAM


@pytest.fixture
def ready(sense: Sense) -> Sense:
    for camera in Camera:
        sense.check(camera)
    return sense


def capture_ms(ready: Sense, camera: Camera) -> float:
    times = ready.device.phase_times(camera)
    return float(times["wait"] + times["store"])


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("ack-late")
def test_late_acknowledge_delays_the_measurement(ready: Sense, camera: Camera) -> None:
    ready.inject("ack-late", target=ACK[camera], delay_us=4_000)  # whatever the frame
    ready.check(camera)
    assert ready.said()[-1] == "rises"
    assert ready.now_s - ready.faults.log[-1].time_ps / 1e12 > 0.008
    ready.faults.clear()
    ready.check(camera)


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize(
    ("kind", "options"),
    [("ack-lost", {}), ("ack-late", {"delay_us": 80_000}), ("ack-stuck", {"level": 0})],
)
@pytest.mark.fault
def test_missing_acknowledge_times_out(
    ready: Sense, camera: Camera, kind: str, options: dict[str, Any]
) -> None:
    before = ready.picture(camera)
    ready.inject(kind, target=ACK[camera], **options)
    assert ready.outcome(camera) == TIMED_OUT
    assert capture_ms(ready, camera) == pytest.approx(70, abs=2)
    assert (ready.picture(camera) != before).any()  # the FPGA has stored it all the same
    ready.faults.clear()
    ready.check(camera)
    ready.check(Camera(1 - camera))


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("fpga-dead")
def test_dead_fpga_times_out_and_the_other_half_measures(ready: Sense, camera: Camera) -> None:
    before = ready.picture(camera)
    ready.inject("fpga-dead", target=HALVES[camera])
    assert ready.outcome(camera) == TIMED_OUT
    assert (ready.picture(camera) == before).all()  # nothing was stored
    ready.check(Camera(1 - camera))
    ready.faults.clear()
    ready.check(camera)


@pytest.mark.fault("ack-stuck")
def test_stuck_acknowledge_measures_the_old_earth(ready: Sense) -> None:
    before = ready.picture()
    ready.board.scene = EarthSunScene.facing(nadir_deg=(5, 5))
    check_right(ready.measure_with("ack-stuck", target="NADACK"))
    assert capture_ms(ready, Camera.NADIR) < 1
    np.testing.assert_array_equal(ready.picture(), before)
    again = ready.measure()
    assert (again.alpha_deg, again.beta_deg) == pytest.approx((5, 5), abs=0.1)


@pytest.mark.parametrize(
    ("profile", "detected"),
    [("published", DetectResult.SUCCESS), ("extended", DetectResult.SUN_NOT_FOUND)],
)
@pytest.mark.fault("ack-stuck")
def test_stuck_acknowledge_measures_the_old_sun_or_none(
    ready: Sense, detected: DetectResult
) -> None:
    """The FPGA clears the first Sun pixel when it starts to store; the flown gateware keeps it."""
    before = ready.picture(Camera.SUN)
    ready.inject("ack-stuck", target="SUNACK")
    assert ready.outcome(Camera.SUN) == (STORED, detected)
    np.testing.assert_array_equal(ready.picture(Camera.SUN), before)
    ready.faults.clear()
    ready.check(Camera.SUN)


@pytest.mark.parametrize("pin", PINS)
@pytest.mark.parametrize("line", quick([240, BEFORE], 1))
@pytest.mark.fault("control-glitch")
def test_glitch_during_store_loses_the_frame(ready: Sense, line: int, pin: str) -> None:
    ready.faults.inject("control-glitch", target=pin, at_s=line_s(ready.await_frame(), line))
    if line == BEFORE or pin == "SUNEN":  # of the other half
        ready.check()
        assert capture_ms(ready, Camera.NADIR) < 70
    else:
        assert ready.outcome() == TIMED_OUT  # the next frame would be too late
    assert ready.said() == ["goes to 0" if pin == "SUNEN" else "goes to 1"]
    ready.check()


def glitch_while_reading(ready: Sense, camera: Camera, pin: str) -> Any:
    """A glitch in the middle of a half's edge data."""
    kernel, engine = ready.board.kernel, ready.board.engine
    while not engine.get_pin("RNW") or engine.get_pin(ENABLES[camera]):
        yield kernel.timeout(10**8)
    ready.inject("control-glitch", target=pin, after_s=SEARCHING_S[camera])


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("pin", PINS)
@pytest.mark.fault("control-glitch")
def test_glitch_during_scan_spoils_the_earth(ready: Sense, pin: str) -> None:
    """The FPGA restarts its scan, so the program attributes edges to the wrong lines."""
    ready.board.kernel.process(glitch_while_reading(ready, Camera.NADIR, pin))
    assert ready.outcome() == (STORED, DetectResult.BAD_FIT)
    assert ready.device.details(Camera.NADIR)["PixelsRead"] == 9920  # as without
    ready.check()


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("pin", PINS)
@pytest.mark.fault("control-glitch")
def test_glitch_during_window_read_spoils_the_sun(ready: Sense, pin: str) -> None:
    """The remaining bytes restart at the coordinates and the first rows."""
    ready.board.kernel.process(glitch_while_reading(ready, Camera.SUN, pin))
    found = ready.measure(Camera.SUN)
    assert (found.capture, found.detect) == (STORED, DetectResult.SUN_NOT_FOUND)
    assert ready.device.quality(Camera.SUN).reason is Reason.NOT_ROUND
    ready.check(Camera.SUN)


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
