"""Every result code but that of a latch-up, each from a scene that causes it."""

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.angles import angles_from_vector
from cubestack.emulator.scene.earth_sun import EarthSunScene, Reflection, Target
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult
from tests.system.conftest import Open

NOON = EarthSunScene()
DARK = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))


def test_on_the_way_to_a_result(ready: Open) -> None:
    with ready(NOON) as opened:
        cubesense = opened.client
        for camera in Camera:
            found = cubesense.result(camera)
            assert (found.capture, found.detect) == (CaptureResult.START_UP, DetectResult.START_UP)
        cubesense.client.command("CaptureAndDetect", Camera=Camera.SUN, Sram=0)
        found = cubesense.result(Camera.SUN)
        assert (found.capture, found.detect) == (CaptureResult.PENDING, DetectResult.PENDING)
        assert cubesense.wait_measured(Camera.SUN).detected
        assert cubesense.capture(Camera.NADIR) is CaptureResult.STORED_OWN_SRAM
        assert cubesense.result(Camera.NADIR).detect is DetectResult.NONE_SCHEDULED


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


def hot(scene: EarthSunScene, pixels: int, pairs: int) -> EarthSunView:
    return EarthSunView(scene, FisheyeCondition(hot_pixels=pixels, hot_pairs=pairs))


RESULTS = {
    "no Earth in view": (EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0)), "TOO_FEW_EDGES"),
    "night side": (EarthSunScene(sun=(0, 0, 1), glow_km=0), "TOO_FEW_EDGES"),
    "many lights": (many_lights(), "TOO_MANY_EDGES"),
    "terminator": (EarthSunScene(sun=(1, 0, -0.3)), "BAD_FIT"),
    "Sun behind": (DARK, "SUN_NOT_FOUND"),
    "Sun beside": (EarthSunScene(nadir=(1, 0, 0), sun=(0.3, 0, 1)), "SUN_NOT_FOUND"),
    "many hot pixels": (hot(DARK, 50, 20), "SUN_NOT_FOUND"),
    "few beside the Sun": (hot(NOON, 20, 5), "SUCCESS"),
}


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("name", RESULTS)
def test_result_of_a_scene(ready: Open, name: str) -> None:
    scene, expected = RESULTS[name]
    camera = Camera.SUN if expected in ("SUN_NOT_FOUND", "SUCCESS") else Camera.NADIR
    with ready(scene) as opened:
        assert opened.client.capture_and_detect(camera).detect.name == expected


def test_a_terminator_makes_a_wrong_direction_as_printed(ready: Open) -> None:
    with ready(RESULTS["terminator"][0], profile="published") as opened:
        found = opened.client.capture_and_detect(Camera.NADIR)
        truth = opened.board.truth(Camera.NADIR)
        assert found.detected
        assert abs(found.alpha_deg - truth.alpha_deg) > 5
