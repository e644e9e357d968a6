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
def test_stuck_acknowledge_reads_noise_as_the_first_picture(star: Star, good: np.ndarray) -> None:
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
def test_stuck_acknowledge_reads_the_old_picture_again(star: Star) -> None:
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
def test_glitch_during_read_restarts_the_picture(star: Star, good: np.ndarray, pin: str) -> None:
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
