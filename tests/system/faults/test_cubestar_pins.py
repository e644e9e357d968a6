from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.scene.sky import SkyScene

from .bench import FAILED, GOOD, ONE_FRAME_MS, READING_S, STORING_S, TWO_FRAMES_MS, Star


def watch_ack(star: Star) -> list[tuple[int, int]]:
    """ACK as read by the processor and as driven by the FPGA, at each read from now on."""
    seen: list[tuple[int, int]] = []
    engine, real = star.board.processor.fpga, star.board.engine
    see = engine.get_pin

    def get_pin(pin: str) -> int:
        level = int(see(pin))
        if pin == "ACK":
            seen.append((level, real.get_pin(pin)))
        return level

    engine.get_pin = get_pin
    return seen


@pytest.mark.fault("ack-late")
def test_late_acknowledge_delays_the_capture(star: Star, good: np.ndarray) -> None:
    star.inject("ack-late", delay_us=300_000)
    seen = watch_ack(star)
    assert star.capture() == GOOD
    assert (0, 1) in seen  # not seen yet
    assert seen[-1] == (1, 1)
    assert star.stored_for_ms == pytest.approx(ONE_FRAME_MS + 300, abs=1)
    np.testing.assert_array_equal(star.stored, good)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("ack-late", {"delay_us": 3e6}), ("ack-lost", {}), ("ack-stuck", {"level": 0})],
)
@pytest.mark.fault
def test_missing_acknowledge_times_out(star: Star, kind: str, options: dict[str, Any]) -> None:
    star.inject(kind, **options)
    seen = watch_ack(star)
    assert star.capture() == FAILED
    assert seen[-1] == (0, 1)
    assert star.stored_for_ms == pytest.approx(2000, abs=10)
    star.faults.clear()
    assert star.measure() == "CALCULATED"


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.fault("ack-stuck")
def test_stuck_acknowledge_reads_noise_as_the_first_image(star: Star, good: np.ndarray) -> None:
    star.inject("ack-stuck", level=1)
    seen = watch_ack(star)
    status, flags = star.capture()
    assert seen[0] == (1, 0)
    assert status == "DETECTION_FAILED"  # noise: what the memory held at power-up has no stars
    assert "ImageCaptureError" not in flags
    assert star.stored_for_ms < 1
    assert (star.transferred != good).mean() > 0.9


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.fault("ack-stuck")
def test_stuck_acknowledge_reads_the_old_image_again(star: Star) -> None:
    assert star.capture() == GOOD
    before = star.device.attitude()
    star.board.camera.scene = SkyScene.pointing(90, -1)
    assert star.capture_with("ack-stuck", level=1) == GOOD
    old = star.device.attitude()
    assert (old.valid, old.frame) == (True, before.frame + 1)
    np.testing.assert_allclose(old.quaternion, before.quaternion, atol=1e-6)
    assert star.capture() == GOOD
    new, truth = star.device.attitude(), star.board.truth()
    assert attitude_error_deg(new.quaternion, truth)[0] < 0.1
    assert attitude_error_deg(old.quaternion, truth)[0] > 5


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
@pytest.mark.fault("control-glitch")
def test_glitch_during_store_loses_a_frame(star: Star, good: np.ndarray, pin: str) -> None:
    star.faults.inject("control-glitch", target=pin, at_s=STORING_S)
    star.board.kernel.process(look_at(star, pin, STORING_S, levels := []))
    assert star.capture() == GOOD
    up = int(pin == "ENABLE")
    assert levels == [up, 1 - up, up]
    assert star.said() == [f"goes to {1 - up}"]
    assert star.stored_for_ms == pytest.approx(TWO_FRAMES_MS, abs=1)


def look_at(star: Star, pin: str, at_s: float, levels: list[int]) -> Any:
    """Levels of a pin of the FPGA 50 ns before, 100 ns and 300 ns after ``at_s``."""
    kernel, engine = star.board.kernel, star.board.engine
    for after_ns in (-50, 100, 300):
        yield kernel.timeout(round(at_s * 1e12) + after_ns * 1000 - kernel.now)
        engine.run(max(kernel.now, engine.now_ps))
        levels.append(engine.get_pin(pin))


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
@pytest.mark.fault("control-glitch")
def test_glitch_during_read_restarts_the_image(star: Star, good: np.ndarray, pin: str) -> None:
    star.faults.inject("control-glitch", target=pin, at_s=READING_S)
    status, flags = star.capture()
    assert status != "CAPTURE_FAILED"
    assert flags <= {"LessThanThreeStarsID"}  # the picture's beginning stands in its middle
    assert star.stored_for_ms == pytest.approx(ONE_FRAME_MS, abs=1)
    np.testing.assert_array_equal(star.stored, good)
    picture, whole = star.transferred.ravel(), good.ravel()
    begun = int(np.argmax(picture != whole))
    assert begun > 100_000
    starts = range(begun - 2000, begun + 1)  # black pixels are the same anywhere
    start = next(at for at in starts if np.array_equal(picture[at + 2 :], whole[2 : -at or None]))
    number = -(-start // 128) + 1  # the host sees the picture's beginning there
    first = 128 * number - start
    np.testing.assert_array_equal(star.block(number), whole[first : first + 128])
    assert first < 1024


X, Y = 700, 30
BLOCK = (1024 * Y + X) // 128


@pytest.mark.parametrize("kind", ["clock-lost", "clock-extra"])
@pytest.mark.fault
def test_wrong_pixel_clock_shifts_the_rest_of_a_line(
    star: Star, good: np.ndarray, kind: str
) -> None:
    assert star.capture_with(kind, row=Y, column=X) == GOOD
    expected = good.copy()
    if kind == "clock-lost":
        expected[Y, X:-1] = good[Y, X + 1 :]
        expected[Y, -1] = star.stored[Y, -1]  # never written
    else:
        expected[Y, X + 1 :] = good[Y, X:-1]
        assert not star.board.engine.violations
    np.testing.assert_array_equal(star.stored, expected)
    np.testing.assert_array_equal(star.block(BLOCK), expected.reshape(-1, 128)[BLOCK])


@pytest.mark.fault("line-missing")
def test_line_missing_in_all_frames_times_out(star: Star) -> None:
    assert star.capture_with("line-missing", row=100) == FAILED
    assert star.stored_for_ms == pytest.approx(2000, abs=10)
    assert star.measure() == "CALCULATED"


@pytest.mark.fault("line-missing")
def test_line_missing_in_one_frame_stores_the_next_frame(star: Star, good: np.ndarray) -> None:
    assert star.capture_with("line-missing", row=100, for_s=0.5) == GOOD
    assert star.stored_for_ms == pytest.approx(TWO_FRAMES_MS, abs=1)
    assert (star.stored != good).mean() < 0.1  # the noise of another frame


@pytest.mark.parametrize(
    ("kind", "value"), [("pixel-hot", 255), ("pixel-dead", 0), ("column-defect", 200)]
)
@pytest.mark.fault
def test_faulty_pixels_are_not_detected_as_stars(
    star: Star, good: np.ndarray, kind: str, value: int
) -> None:
    brightest = divmod(int(good.argmax()), 1024)
    y, x = brightest if kind == "pixel-dead" else (Y, X)
    assert abs(int(good[y, x]) - value) > 50
    place = {"level": value} if kind == "column-defect" else {"y": y}
    assert star.capture_with(kind, x=x, **place) == GOOD
    expected = good.copy()
    expected[place.get("y", slice(None)), x] = value
    np.testing.assert_array_equal(star.stored, expected)
    number, at = divmod(1024 * y + x, 128)
    assert star.block(number)[at] == value
    stars = star.telemetry("DetectionSummary")["NumStarsDetected"]
    star.capture()
    assert star.telemetry("DetectionSummary")["NumStarsDetected"] == stars


@pytest.mark.fault("column-defect")
def test_temporary_defect_affects_the_lines_of_its_time(star: Star) -> None:
    star.faults.inject("column-defect", x=3, at_s=STORING_S, for_s=0.01)
    star.capture()
    lines = np.flatnonzero(star.stored[:, 3] == 255)
    assert 0 < len(lines) < 512
    assert np.all(np.diff(lines) == 1)


@pytest.mark.fault("blooming")
def test_blooming_prevents_an_attitude(star: Star, good: np.ndarray) -> None:
    length = 60
    outcome = star.capture_with("blooming", threshold=40, length=length)
    flags = {"QuestindexError", "MaxInvalidStarsDetectionError"}
    assert outcome == ("CALCULATION_FAILED", flags)
    expected = good.copy()
    for y, x in np.argwhere(good >= 40):
        expected[max(0, y - length) : y + length + 1, x] = 255
    np.testing.assert_array_equal(star.stored, expected)
    assert star.capture()[0] == "CALCULATED"


@pytest.mark.fault("camera-dead")
def test_dead_camera_is_noticed_on_its_control_bus(star: Star, good: np.ndarray) -> None:
    began_s = star.now_s
    assert star.capture_with("camera-dead") == ("CAPTURE_FAILED", {"ISSetupError"})
    assert star.now_s - began_s < 0.1
    assert star.board.camera.segment_at(star.board.kernel.now) is not None  # it is back
    assert star.measure() == "CALCULATED"


@pytest.mark.fault("camera-dead")
def test_overlapping_camera_faults_last_as_long_as_the_longer(star: Star) -> None:
    star.inject("camera-dead", for_s=1.0)
    star.inject("camera-dead", for_s=0.1)
    star.client.pause(0.5)
    assert star.capture() == ("CAPTURE_FAILED", {"ISSetupError"})
    star.client.pause(0.6)
    star.client.command("ClearErrorFlags")
    assert star.capture() == GOOD


@pytest.mark.fault("camera-dead")
def test_camera_that_dies_during_store_is_set_up_again(star: Star) -> None:
    star.faults.inject("camera-dead", at_s=STORING_S)
    assert star.capture() == ("CAPTURE_FAILED", {"ImageCaptureError", "ISDisableError"})
    assert star.stored_for_ms == pytest.approx(2000, abs=10)
    assert star.said() == ["no clock, no answer"]
    star.client.command("ClearErrorFlags")
    assert star.capture() == ("CAPTURE_FAILED", {"ISSetupError"})
    star.faults.clear()
    star.client.command("ClearErrorFlags")
    assert star.capture() == GOOD
    assert star.stored_for_ms == pytest.approx(ONE_FRAME_MS, abs=1)


@pytest.mark.fault("camera-dead")
def test_camera_restarts_with_its_reset_exposure(star: Star) -> None:
    assert star.capture() == GOOD
    usual_ms, usual_light = star.stored_for_ms, light(star)
    star.inject("camera-dead", for_s=0.05)
    star.client.pause(0.1)
    for _ in range(2):
        assert star.capture()[1] == set()
        assert star.stored_for_ms == pytest.approx(88, abs=1)
        assert light(star) < 0.9 * usual_light
    star.client.command("SetFrameRate", FrameRate=8)  # a change sets it up again
    star.capture()
    star.client.command("SetFrameRate", FrameRate=7)
    assert star.capture() == GOOD
    assert star.stored_for_ms == pytest.approx(usual_ms, abs=10)
    assert light(star) == pytest.approx(usual_light, rel=0.1)


def light(star: Star) -> float:
    return float(sum(found.intensity for found in star.device.stars()))
