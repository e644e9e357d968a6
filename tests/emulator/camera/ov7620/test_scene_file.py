import textwrap
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620 import scene_file
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.scene.earth_sun import CameraTarget, Reflection
from cubestack.emulator.scene.hazards import Clouds, Terminator

from ..conftest import check_refused, save

SUN, NADIR = CameraTarget.SUN, CameraTarget.NADIR

SCENE = """
kind = "earth-sun"
altitude_km = 600
nadir_deg = [10.0, -20.0]
sun = [0.0, 3.0, -4.0]
moon = [2, 0, 0]
rate_deg_s = [0.0, 0.1, 0.0]
bloom_px = 6.5
unevenness = 0.2
glow_km = 0
hot_pixels = 5
hot_pairs = 2
noise = false
seed = 9
[nadir_camera]
boresight = [1.0, 0.0, 0.0]
right = [0.0, 1.0, 0.0]
[[reflections]]
camera = "sun"
at_deg = [20.0, -10.0]
radius_px = 4
level = 200
"""


def test_scene_file_loads_an_earth_sun_scene(tmp_path: Path) -> None:
    view = load_earth_sun_scene(save(tmp_path, SCENE))
    scene = view.scene
    truth = scene.truth(NADIR, 0)
    assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((10, -20))
    np.testing.assert_allclose(scene.sun, [0, 0.6, -0.8])
    np.testing.assert_allclose(scene.moon, [1, 0, 0])
    np.testing.assert_allclose(scene.nadir_camera.matrix[2], [1, 0, 0])
    assert scene.reflections == (Reflection(SUN, 20.0, -10.0, 4.0, 200.0),)
    assert (scene.altitude_km, scene.unevenness, scene.glow_km, scene.seed) == (600, 0.2, 0, 9)
    assert view.condition == FisheyeCondition(6.5, 5, 2, noise=False, seed=9)
    assert tuple(np.asarray(scene.rate_deg_s)) == (0, 0.1, 0)


def test_example_in_the_documentation_is_a_scene(tmp_path: Path) -> None:
    example = scene_file.__doc__.split("::\n", 1)[1].rsplit("\n\n", 1)[0]
    scene = load_earth_sun_scene(save(tmp_path, textwrap.dedent(example))).scene
    assert scene.reflections == (Reflection(SUN, 20.0, -10.0, 4.0, 200.0),)
    assert scene.truth(NADIR, 0).visible


def test_scene_file_sets_the_lens_and_rejects_invalid_values(tmp_path: Path) -> None:
    text = f"{LENS}centre_px = [1, -2]\nradial_deg = [[40, 0.5], [60.0, 1]]"
    condition = load_earth_sun_scene(save(tmp_path, text)).condition
    assert condition.sun_lens == LensError((1.0, -2.0), ((40.0, 0.5), (60.0, 1.0)))
    assert condition.nadir_lens is None


def test_minimal_earth_sun_scene_file_has_defaults(tmp_path: Path) -> None:
    view = load_earth_sun_scene(save(tmp_path, 'kind = "earth-sun"'))
    assert view.scene.altitude_km == 750
    assert view.scene.moon is None
    assert view.condition == FisheyeCondition()


KIND = 'kind = "earth-sun"\n'
LENS = f"{KIND}[sun_lens]\n"
BALL = 'kind = "ball"\n'
DISC = f'{KIND}[[reflections]]\ncamera = "sun"\nradius_px = 1\n'


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", 'kind must be "earth-sun" or "ball" for a sun and nadir sensor, not None'),
        ('kind = "sky"', "not 'sky'"),
        ("kind", "is not a TOML file"),
        (f"{KIND}height = 3", "unknown key 'height'; allowed are nadir, sun, moon"),
        (f"{KIND}sun = [1, 0, 0]\nsun_deg = [1, 0]", "give either sun or sun_deg, not both"),
        (f"{KIND}nadir = [0, 0, 0]", "nadir must be 3 numbers, not all 0, not (0.0, 0.0, 0.0)"),
        (f"{KIND}[sun_camera]\nright = [1, 0, 0]", "sun_camera: needs the key boresight"),
        (f"{KIND}[sun_camera]\nboresight = [1, 0, 0]", "sun_camera: right must not be along the"),
        (f"{KIND}[sun_camera]\nup = 1", "sun_camera: unknown key 'up'; allowed are boresight"),
        (f'{KIND}[[reflections]]\ncamera = "sun"', "needs the keys radius_px, level, at_"),
        (f"{DISC}at_deg = [90, 90]\nlevel = 1", "within 95.0 deg of the boresight, not 90.0, 90.0"),
        (f"{LENS}radial_deg = 3", "sun_lens: radial_deg must be a list, not 3"),
        (f"{LENS}radial_deg = [[1]]", "sun_lens: radial_deg must be a list of 2 numbers"),
        (f"{LENS}radial_deg = [[99, 1]]", "sun_lens: radial_deg must have rising field angles"),
        (f"{LENS}colour = 1", "unknown key 'colour'; allowed are centre_px"),
        (f"{BALL}radius_mm = 0", "radius_mm must be above 0 mm, not 0"),
        (f"{BALL}offset_mm = [0, 0, 40]", "offset_mm must leave the camera outside the ball"),
        (f"{BALL}nadir = [0, 0, 1]", "unknown key 'nadir'; allowed are angle_deg"),
    ],
)
def test_errors_are_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    check_refused(load_earth_sun_scene, save(tmp_path, text), complaint)


def test_scene_file_loads_the_test_ball(tmp_path: Path) -> None:
    text = f"{BALL}angle_deg = [20, -10]\nseed = 4\nnoise = false\n[nadir_lens]\n"
    view = load_earth_sun_scene(save(tmp_path, text + "centre_px = [1, 0]"))
    truth = view.scene.truth(CameraTarget.NADIR, 0)
    assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((20, -10))
    assert view.scene.altitude_km == pytest.approx(748.4, abs=0.1)
    assert view.condition.nadir_lens == LensError(centre_px=(1.0, 0.0))
    assert (view.condition.noise, view.condition.seed, view.scene.seed) == (False, 4, 4)


def test_hazards_go_to_scene_or_cameras(tmp_path: Path) -> None:
    text = """
    kind = "earth-sun"
    seed = 5
    [hazards.terminator]
    phase_deg = 110.0
    [hazards.clouds]
    contrast = 0.5
    seed = 9
    [hazards.gradient]
    """
    view = load_earth_sun_scene(save(tmp_path, text))
    light, sensor = view.scene.hazards, view.condition.hazards
    assert light == (Terminator(phase_deg=110.0, seed=5), Clouds(contrast=0.5, seed=9))
    assert [hazard.name for hazard in sensor] == ["gradient"]
    assert view.scene.sun @ -view.scene.nadir == pytest.approx(np.cos(np.radians(110)))
