import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.angles import angles_from_vector
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Reflection
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    Reason,
)
from tests.system.conftest import Open

NOON = EarthSunScene()
TERMINATOR = EarthSunScene(sun=(1, 0, -0.3))
DARK = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))


def test_result_codes_before_a_measurement(ready: Open) -> None:
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


def lights(count: int | None = None) -> EarthSunScene:
    """Discs around every other sample of rows and columns, four edges each; not small ones."""
    lens = LENSES[CameraTarget.NADIR]
    samples = [(x, y) for x in (191, 319, 447) for y in (79, 207, 335)]
    samples += [(x, y) for x in (255, 383, 511) for y in (143, 271, 399)]
    samples = [(x, y) for x, y in samples if np.hypot(x - lens.cx, y - lens.cy) < 200]
    discs = (
        Reflection(CameraTarget.NADIR, *angles_from_vector(vector), radius_px=25.0, level=200.0)
        for vector in lens.unproject(samples[:count])
    )
    return EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0), reflections=tuple(discs))


def hot(scene: EarthSunScene, pixels: int, pairs: int) -> EarthSunView:
    return EarthSunView(scene, FisheyeCondition(hot_pixels=pixels, hot_pairs=pairs))


RESULTS = {
    "no Earth in view": (EarthSunScene(nadir=(0, 0, -1), sun=(1, 0, 0)), "TOO_FEW_EDGES"),
    "night side": (EarthSunScene(sun=(0, 0, 1), glow_km=0), "TOO_FEW_EDGES"),
    "many lights": (lights(), "TOO_MANY_EDGES"),
    "terminator": (TERMINATOR, "SUCCESS"),
    "a few lights": (lights(5), "BAD_FIT"),
    "Sun behind": (DARK, "SUN_NOT_FOUND"),
    "Sun beside": (EarthSunScene(nadir=(1, 0, 0), sun=(0.3, 0, 1)), "SUN_NOT_FOUND"),
    "many hot pixels": (hot(DARK, 50, 20), "SUN_NOT_FOUND"),
    "few beside the Sun": (hot(NOON, 20, 5), "SUCCESS"),
}


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize("name", RESULTS)
def test_result_of_a_scene(ready: Open, name: str) -> None:
    scene, expected = RESULTS[name]
    of_sun = expected == "SUN_NOT_FOUND" or name == "few beside the Sun"
    camera = Camera.SUN if of_sun else Camera.NADIR
    with ready(scene) as opened:
        assert opened.client.capture_and_detect(camera).detect.name == expected


def test_terminator_misleads_the_published_search(ready: Open) -> None:
    with ready(TERMINATOR, profile="published") as opened:
        found = opened.client.capture_and_detect(Camera.NADIR)
        truth = opened.board.truth(Camera.NADIR)
        assert found.detected
        assert abs(found.alpha_deg - truth.alpha_deg) > 5


@pytest.mark.parametrize("profile", ["extended"])
def test_terminator_is_excluded_from_the_limb(ready: Open) -> None:
    with ready(TERMINATOR) as opened:
        found = opened.client.capture_and_detect(Camera.NADIR)
        quality = opened.client.quality(Camera.NADIR)
        error = found.alpha_deg - opened.board.truth(Camera.NADIR).alpha_deg
        assert abs(error) < min(0.3, 3 * quality.sigma_deg[0])
        assert quality.reason is Reason.MEASURED
        assert quality.found > opened.client.details(Camera.NADIR)["Points"]
