"""Every result code, each from a scene or a fault that causes it, read over the serial line."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.angles import angles_from_vector
from cubestack.emulator.scene.earth_sun import EarthSunScene, Reflection, Target
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)

NOON = EarthSunScene()
START_UP = (CaptureResult.START_UP, DetectResult.START_UP)


def detect(
    opened: Callable[..., Any], scene: EarthSunScene | EarthSunView, camera: Camera
) -> DetectResult:
    with opened(scene) as session:
        session.client.client.pause(0.3)
        return session.client.capture_and_detect(camera).detect


def test_before_the_first_measurement(opened: Callable[..., Any]) -> None:
    with opened(NOON) as session:
        session.client.client.pause(0.3)
        for camera in Camera:
            found = session.client.result(camera)
            assert (found.capture, found.detect) == START_UP


def test_pending_from_the_acknowledge_on(opened: Callable[..., Any]) -> None:
    with opened(NOON) as session:
        cubesense = session.client
        cubesense.client.pause(0.3)
        cubesense.client.command("CaptureAndDetect", Camera=Camera.SUN, Sram=Sram.SRAM1)
        found = cubesense.result(Camera.SUN)
        assert (found.capture, found.detect) == (CaptureResult.PENDING, DetectResult.PENDING)
        assert cubesense.wait_measured(Camera.SUN).detected


def test_captured_only(opened: Callable[..., Any]) -> None:
    with opened(NOON) as session:
        session.client.client.pause(0.3)
        assert session.client.capture(Camera.NADIR) is CaptureResult.STORED_OWN_SRAM
        assert session.client.result(Camera.NADIR).detect is DetectResult.NONE_SCHEDULED


def test_no_earth_in_view_is_too_few_edges(opened: Callable[..., Any]) -> None:
    scene = EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0))
    assert detect(opened, scene, Camera.NADIR) is DetectResult.TOO_FEW_EDGES


def test_night_side_is_too_few_edges(opened: Callable[..., Any]) -> None:
    scene = EarthSunScene(sun=(0, 0, 1), glow_km=0)
    assert detect(opened, scene, Camera.NADIR) is DetectResult.TOO_FEW_EDGES


def test_many_lights_are_too_many_edges(opened: Callable[..., Any]) -> None:
    """Discs around every other sample of rows and columns, four edges each."""
    lens = LENSES[Target.NADIR]
    samples = [(x, y) for x in (191, 319, 447) for y in (79, 207, 335)]
    samples += [(x, y) for x in (255, 383, 511) for y in (143, 271, 399)]
    samples = [(x, y) for x, y in samples if np.hypot(x - lens.cx, y - lens.cy) < 200]
    lights = []
    for vector in lens.unproject(samples):
        alpha, beta = angles_from_vector(vector)
        lights.append(Reflection(Target.NADIR, alpha, beta, radius_px=18.0, level=200.0))
    scene = EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0), reflections=tuple(lights))
    assert detect(opened, scene, Camera.NADIR) is DetectResult.TOO_MANY_EDGES


def test_terminator_is_a_bad_fit(opened: Callable[..., Any]) -> None:
    scene = EarthSunScene(sun=(1, 0, -0.3))
    assert detect(opened, scene, Camera.NADIR) is DetectResult.BAD_FIT


@pytest.mark.parametrize("sun", [(0, 0, 1), (0.3, 0, 1)])
def test_sun_behind_the_camera_is_not_found(
    opened: Callable[..., Any], sun: tuple[float, float, float]
) -> None:
    scene = EarthSunScene(nadir=(1, 0, 0), sun=sun)
    assert detect(opened, scene, Camera.SUN) is DetectResult.SUN_NOT_FOUND


def test_hot_pixels_are_no_sun(opened: Callable[..., Any]) -> None:
    dark = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))
    many, few = (FisheyeCondition(hot_pixels=n, hot_pairs=m) for n, m in ((50, 20), (20, 5)))
    assert detect(opened, EarthSunView(dark, many), Camera.SUN) is DetectResult.SUN_NOT_FOUND
    assert detect(opened, EarthSunView(NOON, few), Camera.SUN) is DetectResult.SUCCESS


def test_dead_camera_times_out_and_the_node_goes_on(opened: Callable[..., Any]) -> None:
    with opened(NOON) as session:
        session.client.client.pause(0.3)
        session.board.faults.inject("camera-dead", target="sun")
        found = session.client.capture_and_detect(Camera.SUN)
        assert found.capture is CaptureResult.CAMERA_TIMEOUT
        assert found.detect is DetectResult.NONE_SCHEDULED
        assert session.client.capture_and_detect(Camera.NADIR).detected


@pytest.mark.parametrize("after_ms", [5, 45, 100])
def test_latch_up_during_a_measurement(opened: Callable[..., Any], after_ms: float) -> None:
    """While the picture is awaited or stored, and while lines are searched."""
    with opened(NOON) as session:
        cubesense = session.client
        cubesense.client.pause(0.3)
        cubesense.client.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2)
        cubesense.client.pause(after_ms / 1000)
        session.board.power.latch_up("SRAM2")
        found = cubesense.wait_measured(Camera.NADIR)
        assert found.capture is CaptureResult.SRAM_OVER_CURRENT
        assert not found.detected
        assert cubesense.power().over_current == (False, True)
