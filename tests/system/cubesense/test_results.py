"""Every result code, each from a scene or a fault that causes it, read over the serial line."""

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
from tests.system.conftest import Open

NOON = EarthSunScene()
START_UP = (CaptureResult.START_UP, DetectResult.START_UP)


def detect(ready: Open, scene: EarthSunScene | EarthSunView, camera: Camera) -> DetectResult:
    with ready(scene) as opened:
        return opened.client.capture_and_detect(camera).detect


def test_before_the_first_measurement(ready: Open) -> None:
    with ready(NOON) as opened:
        for camera in Camera:
            found = opened.client.result(camera)
            assert (found.capture, found.detect) == START_UP


def test_pending_from_the_acknowledge_on(ready: Open) -> None:
    with ready(NOON) as opened:
        cubesense = opened.client
        cubesense.client.command("CaptureAndDetect", Camera=Camera.SUN, Sram=Sram.SRAM1)
        found = cubesense.result(Camera.SUN)
        assert (found.capture, found.detect) == (CaptureResult.PENDING, DetectResult.PENDING)
        assert cubesense.wait_measured(Camera.SUN).detected


def test_captured_only(ready: Open) -> None:
    with ready(NOON) as opened:
        assert opened.client.capture(Camera.NADIR) is CaptureResult.STORED_OWN_SRAM
        assert opened.client.result(Camera.NADIR).detect is DetectResult.NONE_SCHEDULED


def many_lights() -> EarthSunScene:
    """Discs around every other sample of rows and columns, four edges each."""
    lens = LENSES[Target.NADIR]
    samples = [(x, y) for x in (191, 319, 447) for y in (79, 207, 335)]
    samples += [(x, y) for x in (255, 383, 511) for y in (143, 271, 399)]
    samples = [(x, y) for x, y in samples if np.hypot(x - lens.cx, y - lens.cy) < 200]
    lights = (
        Reflection(Target.NADIR, *angles_from_vector(vector), radius_px=18.0, level=200.0)
        for vector in lens.unproject(samples)
    )
    return EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0), reflections=tuple(lights))


UNDETECTED = {
    "no Earth in view": (
        EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0)),
        DetectResult.TOO_FEW_EDGES,
    ),
    "night side": (EarthSunScene(sun=(0, 0, 1), glow_km=0), DetectResult.TOO_FEW_EDGES),
    "many lights": (many_lights(), DetectResult.TOO_MANY_EDGES),
    "terminator": (EarthSunScene(sun=(1, 0, -0.3)), DetectResult.BAD_FIT),
    "Sun behind": (EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1)), DetectResult.SUN_NOT_FOUND),
    "Sun beside": (EarthSunScene(nadir=(1, 0, 0), sun=(0.3, 0, 1)), DetectResult.SUN_NOT_FOUND),
}


@pytest.mark.parametrize("name", UNDETECTED)
def test_nothing_to_detect(ready: Open, name: str) -> None:
    scene, expected = UNDETECTED[name]
    camera = Camera.SUN if expected is DetectResult.SUN_NOT_FOUND else Camera.NADIR
    assert detect(ready, scene, camera) is expected


def test_hot_pixels_are_no_sun(ready: Open) -> None:
    dark = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))
    many, few = (FisheyeCondition(hot_pixels=n, hot_pairs=m) for n, m in ((50, 20), (20, 5)))
    assert detect(ready, EarthSunView(dark, many), Camera.SUN) is DetectResult.SUN_NOT_FOUND
    assert detect(ready, EarthSunView(NOON, few), Camera.SUN) is DetectResult.SUCCESS


@pytest.mark.parametrize("after_ms", [5, 45, 100])
def test_latch_up_during_a_measurement(ready: Open, after_ms: float) -> None:
    """While the picture is awaited or stored, and while lines are searched."""
    with ready(NOON) as opened:
        cubesense = opened.client
        cubesense.client.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2)
        cubesense.client.pause(after_ms / 1000)
        opened.board.power.latch_up("SRAM2")
        found = cubesense.wait_measured(Camera.NADIR)
        assert found.capture is CaptureResult.SRAM_OVER_CURRENT
        assert not found.detected
        assert cubesense.power().over_current == (False, True)
