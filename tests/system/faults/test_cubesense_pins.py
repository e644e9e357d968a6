"""CubeSense: faults of the acknowledges, and glitches on the pins that command the FPGAs."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult

from .bench import SUN_DEG, Bench
from .cubesense_bench import (
    FAILED,
    await_frame,
    check_next,
    check_right,
    line_s,
    measure,
    measure_with,
    picture,
)

ACK = {Camera.SUN: "SUNACK", Camera.NADIR: "NADACK"}
ENABLES = {Camera.SUN: "SUNEN", Camera.NADIR: "NADEN"}
BEFORE_S = 0.007
"""From a glitch to the frame: the FPGA has yet to see the gap before it."""

SEARCHING_S = {Camera.SUN: 0.0005, Camera.NADIR: 0.05}
"""From the command on: the middle of the edge data."""

OTHER_DEG = (5.0, 5.0)


@pytest.fixture
def ready(sense: Bench) -> Bench:
    """Cameras are set up, and both have measured."""
    for camera in Camera:
        check_right(measure(sense, camera))
    return sense


def capture_ms(bench: Bench, camera: Camera) -> float:
    times = bench.device.phase_times(camera)
    return float(times["wait"] + times["store"])


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("ack-late")
def test_a_late_acknowledge_only_delays(ready: Bench, camera: Camera) -> None:
    ready.inject("ack-late", target=ACK[camera], delay_us=10_000)
    check_right(measure(ready, camera))
    assert ready.said()[-1] == "rises"
    rose_s = ready.faults.log[-1].time_ps / 1e12
    assert ready.now_s - rose_s > 0.008
    ready.faults.clear()
    check_next(ready, camera)


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize(
    ("kind", "options"),
    [("ack-lost", {}), ("ack-late", {"delay_us": 80_000}), ("ack-stuck", {"level": 0})],
)
@pytest.mark.fault
def test_without_acknowledge_the_camera_times_out(
    ready: Bench, camera: Camera, kind: str, options: dict[str, Any]
) -> None:
    before = picture(ready, camera)
    ready.inject(kind, target=ACK[camera], **options)
    found = measure(ready, camera)
    assert (found.capture, found.detect) == FAILED
    assert capture_ms(ready, camera) == pytest.approx(70, abs=2)
    assert (picture(ready, camera) != before).any()  # the FPGA has stored it all the same
    ready.faults.clear()
    check_next(ready, camera)
    check_next(ready, Camera(1 - camera))


@pytest.mark.fault("ack-stuck")
def test_with_an_acknowledge_that_is_always_there_the_old_earth_is_measured(ready: Bench) -> None:
    before = picture(ready)
    ready.board.scene = EarthSunScene.facing(nadir_deg=OTHER_DEG)
    check_right(measure_with(ready, "ack-stuck", target="NADACK"))
    assert capture_ms(ready, Camera.NADIR) < 1
    np.testing.assert_array_equal(picture(ready), before)
    again = measure(ready)
    assert (again.alpha_deg, again.beta_deg) == pytest.approx(OTHER_DEG, abs=0.1)


@pytest.mark.fault("ack-stuck")
def test_with_an_acknowledge_that_is_always_there_no_sun_is_found(ready: Bench) -> None:
    """Its first pixel is forgotten as soon as the FPGA begins to store."""
    before = picture(ready, Camera.SUN)
    ready.inject("ack-stuck", target="SUNACK")
    found = measure(ready, Camera.SUN)
    outcome = found.capture, found.detect
    assert outcome == (CaptureResult.STORED_OWN_SRAM, DetectResult.SUN_NOT_FOUND)
    np.testing.assert_array_equal(picture(ready, Camera.SUN), before)
    ready.faults.clear()
    check_next(ready, Camera.SUN)


@pytest.mark.parametrize("pin", ["NADEN", "RNW", "EDGE", "SHIFT"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_while_storing_costs_the_frame(ready: Bench, pin: str) -> None:
    at_s = line_s(await_frame(ready), 240)
    ready.faults.inject("control-glitch", target=pin, at_s=at_s)
    found = measure(ready)
    assert (found.capture, found.detect) == FAILED  # the next frame would be too late
    assert ready.said() == ["goes to 1"]
    check_next(ready)


@pytest.mark.parametrize("pin", ["NADEN", "RNW", "EDGE", "SHIFT"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_before_the_frame_costs_nothing(ready: Bench, pin: str) -> None:
    at_s = line_s(await_frame(ready), 0) - BEFORE_S
    ready.faults.inject("control-glitch", target=pin, at_s=at_s)
    check_right(measure(ready))
    assert capture_ms(ready, Camera.NADIR) < 70


@pytest.mark.fault("control-glitch")
def test_a_glitch_of_the_other_half_s_enable_costs_nothing(ready: Bench) -> None:
    at_s = line_s(await_frame(ready), 240)
    ready.faults.inject("control-glitch", target="SUNEN", at_s=at_s)
    check_right(measure(ready))


def glitch_while_reading(bench: Bench, camera: Camera, pin: str) -> Any:
    """A glitch in the middle of a half's edge data."""
    kernel, engine = bench.board.kernel, bench.board.engine
    enable, after_s = ENABLES[camera], SEARCHING_S[camera]
    while not engine.get_pin("RNW") or engine.get_pin(enable):
        yield kernel.timeout(10**8)
    bench.inject("control-glitch", target=pin, after_s=after_s)


@pytest.mark.parametrize("pin", ["NADEN", "SUNEN", "RNW", "EDGE", "SHIFT"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_while_scanning_spoils_the_earth(ready: Bench, pin: str) -> None:
    """The FPGA begins its scan anew, so the program takes the wrong lines for its own."""
    ready.board.kernel.process(glitch_while_reading(ready, Camera.NADIR, pin))
    found = measure(ready)
    outcome = found.capture, found.detect
    assert outcome == (CaptureResult.STORED_OWN_SRAM, DetectResult.BAD_FIT)
    assert ready.device.details(Camera.NADIR)["PixelsRead"] == 9920  # as without
    check_next(ready)


@pytest.mark.parametrize("pin", ["NADEN", "SUNEN", "RNW", "EDGE", "SHIFT"])
@pytest.mark.fault("control-glitch")
def test_a_glitch_while_the_window_is_read_moves_the_sun(ready: Bench, pin: str) -> None:
    """Not noticed: the rest of the window begins with the coordinates and the first rows."""
    ready.board.kernel.process(glitch_while_reading(ready, Camera.SUN, pin))
    found = measure(ready, Camera.SUN)
    outcome = found.capture, found.detect
    assert outcome == (CaptureResult.STORED_OWN_SRAM, DetectResult.SUCCESS)
    assert 0.2 < abs(found.beta_deg - SUN_DEG[1]) < 3
    check_next(ready, Camera.SUN)
