"""CubeStar: faults of the acknowledge, and glitches on the pins that command the FPGA."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.scene.sky import SkyScene

from .bench import Bench
from .cubestar_bench import (
    COLUMNS,
    FAILED,
    GOOD,
    ONE_FRAME_MS,
    READING_S,
    STORING_S,
    TWO_FRAMES_MS,
    block,
    capture,
    capture_with,
    stored,
    stored_for_ms,
    transferred,
)

NEVER_S = 2.0  # the time limit


class Pin:
    """A pin as the processor sees it and as the FPGA drives it, at each look."""

    def __init__(self, bench: Bench, name: str) -> None:
        self.seen: list[tuple[int, int]] = []
        processor = bench.board.processor
        engine, real = processor.fpga, bench.board.engine
        see = engine.get_pin

        def get_pin(pin: str) -> int:
            level = int(see(pin))
            if pin == name:
                self.seen.append((level, real.get_pin(name)))
            return level

        engine.get_pin = get_pin


@pytest.mark.fault("ack-late")
def test_a_late_acknowledge_only_delays(star: Bench, good: np.ndarray) -> None:
    star.inject("ack-late", delay_us=300_000)
    pin = Pin(star, "ACK")
    assert capture(star) == GOOD
    assert (0, 1) in pin.seen  # not seen yet
    assert pin.seen[-1] == (1, 1)
    assert stored_for_ms(star) == pytest.approx(ONE_FRAME_MS + 300, abs=1)
    np.testing.assert_array_equal(stored(star), good)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("ack-late", {"delay_us": 3e6}), ("ack-lost", {}), ("ack-stuck", {"level": 0})],
)
@pytest.mark.fault
def test_without_acknowledge_the_capture_fails_in_time(
    star: Bench, kind: str, options: dict[str, Any]
) -> None:
    star.inject(kind, **options)
    pin = Pin(star, "ACK")
    assert capture(star) == FAILED
    assert pin.seen[-1] == (0, 1)
    assert stored_for_ms(star) == pytest.approx(1000 * NEVER_S, abs=10)
    star.faults.clear()
    assert star.device.capture_and_process().name == "CALCULATED"


@pytest.mark.fault("ack-stuck")
def test_with_an_acknowledge_that_is_always_there_noise_is_the_first_picture(
    star: Bench, good: np.ndarray
) -> None:
    star.inject("ack-stuck", level=1)
    pin = Pin(star, "ACK")
    status, flags = capture(star)
    assert pin.seen[0] == (1, 0)
    assert status == "IDENTIFICATION_FAILED"  # noise: what the memory held at power-up
    assert "ImageCaptureError" not in flags
    assert stored_for_ms(star) < 1
    assert (transferred(star) != good).mean() > 0.9


@pytest.mark.fault("ack-stuck")
def test_with_an_acknowledge_that_is_always_there_the_old_picture_is_the_new_one(
    star: Bench,
) -> None:
    assert capture(star) == GOOD
    before = star.device.attitude()
    star.board.camera.scene = SkyScene.pointing(90, -1)
    assert capture_with(star, "ack-stuck", level=1) == GOOD
    old = star.device.attitude()
    assert old.valid
    assert old.frame == before.frame + 1
    np.testing.assert_allclose(old.quaternion, before.quaternion, atol=1e-6)
    assert capture(star) == GOOD
    new, truth = star.device.attitude(), star.board.truth()
    assert attitude_error_deg(new.quaternion, truth)[0] < 0.1
    assert attitude_error_deg(old.quaternion, truth)[0] > 5


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_while_storing_costs_a_frame(star: Bench, good: np.ndarray, pin: str) -> None:
    star.faults.inject("control-glitch", target=pin, at_s=STORING_S)
    star.board.kernel.process(look_at(star, pin, STORING_S, levels := []))
    assert capture(star) == GOOD
    up = int(pin == "ENABLE")
    assert levels == [up, 1 - up, up]
    assert star.said() == [f"goes to {1 - up}"]
    assert stored_for_ms(star) == pytest.approx(TWO_FRAMES_MS, abs=1)


def look_at(bench: Bench, pin: str, at_s: float, levels: list[int]) -> Any:
    """Levels of a pin of the FPGA 50 ns before, 100 ns and 300 ns after ``at_s``."""
    kernel, engine = bench.board.kernel, bench.board.engine
    for after_ns in (-50, 100, 300):
        yield kernel.timeout(round(at_s * 1e12) + after_ns * 1000 - kernel.now)
        engine.run(max(kernel.now, engine.now_ps))
        levels.append(engine.get_pin(pin))


@pytest.mark.parametrize("pin", ["ENABLE", "RNW"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_while_reading_starts_over(star: Bench, good: np.ndarray, pin: str) -> None:
    star.faults.inject("control-glitch", target=pin, at_s=READING_S)
    status, flags = capture(star)
    assert status != "CAPTURE_FAILED"
    assert flags == set()
    assert stored_for_ms(star) == pytest.approx(ONE_FRAME_MS, abs=1)
    np.testing.assert_array_equal(stored(star), good)
    picture, whole = transferred(star).ravel(), good.ravel()
    begun = int(np.argmax(picture != whole))
    assert begun > 100_000
    starts = range(begun - 200, begun + 1)  # black pixels are the same anywhere
    start = next(at for at in starts if np.array_equal(picture[at + 2 :], whole[2 : -at or None]))
    number = -(-start // 128) + 1  # the host sees the picture's beginning there
    first = 128 * number - start
    np.testing.assert_array_equal(block(star, number), whole[first : first + 128])
    assert first < COLUMNS
