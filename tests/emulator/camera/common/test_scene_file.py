from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.common.optics import Distortion, Optics
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    pointing_from_matrix,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.hazards import Moon
from cubestack.emulator.scene.sky import SceneError, SkyScene

from ..conftest import check_refused, save

EXAMPLES = Path(__file__).parents[4] / "examples/scenes"


def load(path: Path) -> SkyView:
    return load_scene(path, CONDITION)


SCENE = """
kind = "sky"
ra_deg = 83.8
dec_deg = -5
roll_deg = 30.0
rate_deg_s = [0.0, 0.1, 0.0]
mag_limit = 3.8
epoch = 2030.5
noise = false
seed = 7
false_stars = 5
false_star_mag = [1.0, 2.0]
hot_pixels = 524288
temperature_c = -10
[optics]
psf_sigma_px = 1.2
distortion = "toolbox"
[[poses]]
at_s = 10
quaternion = [0, 0, 0, 2]
"""


def test_scene_file_loads_a_sky_scene(tmp_path: Path) -> None:
    view = load(save(tmp_path, SCENE))
    scene, condition = view.scene, view.condition
    np.testing.assert_allclose(scene.quaternion, quaternion_from_pointing(83.8, -5, 30))
    assert tuple(scene.rate_deg_s) == (0.0, 0.1, 0.0)
    assert (scene.mag_limit, scene.epoch, scene.seed) == (3.8, 2030.5, 7)
    assert (scene.false_stars, scene.false_star_mag) == (5, (1.0, 2.0))
    assert condition == SkyCondition(
        replace(LENS, psf_sigma_px=1.2, distortion=Distortion.TOOLBOX),
        noise=False,
        seed=7,
        temperature_c=-10,
        hot_pixels=1024 * 512,
    )
    np.testing.assert_allclose(scene.truth(11 * 10**12), [0, 0, 0, 1])


def test_minimal_scene_files_have_defaults(tmp_path: Path) -> None:
    view = load(save(tmp_path, 'kind = "sky"\nra_deg = 1\ndec_deg = 2'))
    assert view.scene.mag_limit is None
    assert view.condition == CONDITION
    Image.new("L", (1024, 512), 9).save(tmp_path / "p.png")
    picture = load(save(tmp_path, 'kind = "picture"\nfile = "p.png"')).scene
    assert picture.truth(0) is None
    assert np.all(picture.pixels == 9)


def test_scene_file_loads_an_image_scene(tmp_path: Path) -> None:
    Image.new("L", (1100, 700), 9).save(tmp_path / "p.png")
    text = 'kind = "picture"\nfile = "p.png"\ncrop = [70, 180]\nexposure_ms = 5\n'
    view = load(save(tmp_path, text + "quaternion = [0, 2, 0, 0]\ntemperature_c = 3"))
    scene = view.scene
    assert (scene.crop, scene.exposure_ms) == ((70, 180), 5.0)
    assert view.condition == replace(CONDITION, temperature_c=3.0)
    np.testing.assert_array_equal(scene.truth(10**15), [0, 1, 0, 0])


POSE = "ra_deg = 1\ndec_deg = 2\n"
SKY = f'kind = "sky"\n{POSE}'
PICTURE = 'kind = "picture"\nfile = "x"\n'
NIGHT = """
kind = "sky"
mount = "earth"
ra_deg = 200
dec_deg = -33.9
[atmosphere]
latitude_deg = -33.9
sidereal_deg = 200
seeing_arcsec = 3
sky_mag = 19.5
"""


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", 'kind must be "sky" or "picture", not None'),
        ('kind = "moon"', "not 'moon'"),
        ('kind = "sky"', "a pose needs either quaternion, or ra_deg and dec_deg"),
        ('kind = "sky"\nra_deg = 1', "needs both ra_deg and dec_deg"),
        (f"{SKY}quaternion = [0, 0, 0, 1]", "either quaternion, or ra_deg"),
        (f"{SKY}magnitude = 3", "unknown key 'magnitude'; allowed are ra_deg, dec"),
        (f"{SKY}at_s = 3", "unknown key 'at_s'"),
        (f"{SKY}epoch = 1{'0' * 400}", "an integer has more than 24 digits"),
        (f"{SKY}false_star_mag = [4, 2]", "must have the brightest first, not 4, 2"),
        (f"{SKY}hot_pixels = 524289", "hot_pixels must be at most 524288, not 524289"),
        (f"{SKY}[optics]\nf = 1", "optics: unknown key 'f'; allowed are focal_leng"),
        (f"{SKY}[[poses]]\nra_deg = 1", "needs both ra_deg and dec_deg"),
        (f"{SKY}[[poses]]\n{POSE}at_s = -1", "poses must be in order of time"),
        ('kind = "sky"\nquaternion = [0, 0, 0, 0]', "a quaternion needs a finite length above 0"),
        ('kind = "picture"', "needs the key file"),
        (f"{PICTURE}quaternion = [0, 0, 0, 0]", "a quaternion needs a finite length above 0"),
        ('kind = "picture"\nfile = "none.png"', "none.png can not be read: No such file"),
        (f"{PICTURE}ra_deg = 1", "unknown key 'ra_deg'; allowed are file, crop"),
        ("kind =", "is not a TOML file"),
        (NIGHT.replace("sidereal_deg = 200", ""), "atmosphere: needs either sidereal_deg, or utc"),
        (NIGHT.replace("sidereal", "longitude"), "sidereal_deg, or utc and longitude_deg"),
        (NIGHT.replace("latitude_deg = -33.9", ""), "atmosphere: needs the key latitude_deg"),
        (NIGHT.replace('"earth"', '"earth"\nrate_deg_s = [0, 1, 0]'), 'mount = "earth" needs one'),
        (NIGHT.replace('"earth"', '"moon"'), "mount must be one of sky, earth, not 'moon'"),
        (
            NIGHT.replace("sidereal_deg = 200", 'utc = "now"\nlongitude_deg = 0'),
            "utc must be a date and time",
        ),
        (f"{SKY}[hazards.moo]", "hazards: unknown key 'moo'; allowed are moon, "),
        (f"{SKY}[hazards.moon]\nphase = 1", "hazards: moon: unknown key 'phase'; allowed are "),
        (f"{SKY}[hazards.moon]\nscatter = 2", "hazards: moon: scatter must be 0 to 0.2, not 2"),
        (f"{SKY}[hazards.moon]\nsun = 2", "hazards: moon: sun must be a list, not 2"),
        (f"{SKY}[hazards]\nmoon = 2", "hazards: moon must be a table, not 2"),
    ],
)
def test_errors_are_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    check_refused(load, save(tmp_path, text), complaint)
    check_refused(load, tmp_path / "none.toml", "none.toml can not be read: No such file")


def test_scene_file_changes_the_lens_but_not_the_sensor(tmp_path: Path) -> None:
    text = f"{SKY}[optics]\npsf_sigma_px = 2.5\n"
    for usual in (CONDITION, SkyCondition(double_gauss())):
        view = load_scene(save(tmp_path, text), usual)
        assert view.condition == replace(usual, optics=replace(usual.optics, psf_sigma_px=2.5))
    with pytest.raises(SceneError, match="columns"):
        load(save(tmp_path, text + "columns = 5\n"))


def test_scene_file_sets_atmosphere_and_earth_rotation(tmp_path: Path) -> None:
    scene = load(save(tmp_path, NIGHT)).scene
    assert scene.atmosphere == Atmosphere(-33.9, 200, seeing_arcsec=3, sky_mag=19.5)
    np.testing.assert_allclose(scene.rate_deg_s, earth_rate_deg_s(scene.quaternion))
    utc = NIGHT.replace("sidereal_deg = 200", "utc = 2013-06-01T20:00:00Z\nlongitude_deg = 18.9")
    dated = load(save(tmp_path, utc)).scene
    assert dated.atmosphere.sidereal_deg == pytest.approx(209.4, abs=0.1)


def test_pose_without_an_attitude_continues_from_the_previous_one(tmp_path: Path) -> None:
    turns = "".join(
        f"[[poses]]\nat_s = {start}\nrate_deg_s = {rate}\n"
        for start, rate in ((2, [0, 5, 0]), (4, [0, 0, 0]), (6, [0, 0, 1]))
    )
    scene = load(save(tmp_path, f'kind = "sky"\nra_deg = 10\ndec_deg = 0\n{turns}')).scene
    for time_s, ra_deg in ((1, 10), (3, 5), (5, 0), (9, 0)):
        found = pointing_from_matrix(matrix_from_quaternion(scene.truth(time_s * 10**12)))
        assert (found[0] + 1e-6) % 360 == pytest.approx(ra_deg, abs=1e-5)
    assert found[2] == pytest.approx(-3, abs=1e-6)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_example_scenes_load(path: Path) -> None:
    assert isinstance(load_scene(path, CONDITION, UNCERTAIN).scene, SkyScene)


def test_renders_with_the_calibrated_lens(tmp_path: Path) -> None:
    def drawn(seed: int, more: str = "") -> Optics:
        text = f"{SKY}[optics]\ndrawn = {seed}\n{more}"
        return load_scene(save(tmp_path, text), CONDITION, UNCERTAIN).condition.optics

    lenses = [drawn(seed) for seed in range(40)]
    assert drawn(3) == lenses[3] != drawn(4)
    for name, sigma in UNCERTAIN.items():
        off = np.array([getattr(lens, name) - getattr(LENS, name) for lens in lenses]) / sigma
        assert 0.6 < off.std() < 1.4
        assert abs(off.mean()) < 0.5
    assert drawn(3, "cx = 500.0") == replace(lenses[3], cx=500.0)
    undrawn = save(tmp_path, f"{SKY}[optics]\ndrawn = 1")
    check_refused(load, undrawn, "optics: this lens has no uncertainties to draw from")


HAZARDS = f"""{SKY}
seed = 5
[[hazards.moon]]
direction = [10.0, 21.0]
[[hazards.moon]]
direction = [0, 0, -1]
sun = [1, 0, 0]
seed = 6
[hazards.hot-pixels]
"""


def test_hazards_go_to_scene_and_condition(tmp_path: Path) -> None:
    view = load(save(tmp_path, HAZARDS))
    assert view.scene.hazards == (
        Moon(direction=(10.0, 21.0), seed=5),
        Moon(direction=(0.0, 0.0, -1.0), sun=(1.0, 0.0, 0.0), seed=6),
    )
    assert [(hazard.name, hazard.seed) for hazard in view.condition.hazards] == [("hot-pixels", 5)]
