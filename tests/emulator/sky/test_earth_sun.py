from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.sky.earth_sun import (
    EarthSunScene,
    Mounting,
    Reflection,
    load_earth_sun_scene,
)
from cubestack.emulator.sky.scene_file import SceneError
from cubestack.firmware_model.interface.cubesense_codes import Camera

SUN, NADIR = Camera.SUN, Camera.NADIR
S = 10**12


def save(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_both_cameras_look_at_their_object_by_default() -> None:
    scene = EarthSunScene()
    for camera in Camera:
        truth = scene.truth(camera, 0)
        np.testing.assert_allclose(truth.vector, [0, 0, 1], atol=1e-15)
        assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((0, 0), abs=1e-12)
        assert truth.visible


def test_mounting_is_a_rotation_to_the_pictures_axes() -> None:
    matrix = Mounting([0, 2.0, 0], [3.0, 1.0, 0]).matrix
    np.testing.assert_allclose(matrix @ [0, 1, 0], [0, 0, 1], atol=1e-15)  # boresight
    np.testing.assert_allclose(matrix @ [1, 0, 0], [1, 0, 0], atol=1e-15)  # right
    np.testing.assert_allclose(matrix @ [0, 0, -1], [0, 1, 0], atol=1e-15)  # so that is down
    Rotation.from_matrix(matrix)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_alpha_is_to_the_right_and_beta_down() -> None:
    # Nadir camera along +z, its right side +x: so down is +y.
    scene = EarthSunScene(nadir=[np.sin(0.5), 0, np.cos(0.5)])
    truth = scene.truth(NADIR, 0)
    assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((np.degrees(0.5), 0))
    # Sun camera along -z, its right side +x: so down is -y.
    scene = EarthSunScene(sun=[0, -np.sin(0.5), -np.cos(0.5)])
    truth = scene.truth(SUN, 0)
    assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((0, np.degrees(0.5)))


def test_truth_is_the_direction_from_the_boresight() -> None:
    scene = EarthSunScene.facing(nadir_deg=(30, -40))
    truth = scene.truth(NADIR, 0)
    angle = np.degrees(np.arccos(truth.vector @ [0, 0, 1]))
    assert angle == pytest.approx(50)
    assert truth.vector[0] / truth.vector[1] == pytest.approx(30 / -40)


def test_facing_is_what_the_truth_says_whatever_the_mounting() -> None:
    mounting = Mounting([1, 2, 3], [0, 1, 0])
    scene = EarthSunScene.facing((20, -10), (-5, 60), sun_camera=mounting, altitude_km=400)
    sun, nadir = scene.truth(SUN, 0), scene.truth(NADIR, 0)
    assert (sun.alpha_deg, sun.beta_deg) == pytest.approx((20, -10))
    assert (nadir.alpha_deg, nadir.beta_deg) == pytest.approx((-5, 60))
    assert scene.altitude_km == 400


def test_truth_follows_the_body_rate() -> None:
    rate = np.array([0.3, -0.2, 1.0])
    scene = EarthSunScene.facing(nadir_deg=(10, 20), rate_deg_s=rate)
    before = scene.truth(NADIR, 0).vector
    # The satellite turns by the rate, so what it sees turns the other way.
    expected = Rotation.from_rotvec(np.radians(rate * 4)).inv().apply(before)
    np.testing.assert_allclose(scene.truth(NADIR, 4 * S).vector, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("sun_deg", "visible"), [((94.9, 0), True), ((0, -95.1), False), ((150, 0), False)]
)
def test_sun_is_seen_within_the_field(sun_deg: tuple[float, float], visible: bool) -> None:
    scene = EarthSunScene.facing(sun_deg, altitude_km=1e6)
    assert scene.truth(SUN, 0).visible is visible


def test_sun_behind_the_earth_is_not_seen() -> None:
    # The sun camera looks down here. The limb is 63.48 deg from the nadir.
    down = Mounting([0, 0, 1])
    for theta, visible in ((63.3, False), (63.7, True)):
        scene = EarthSunScene.facing((theta, 0), sun_camera=down)
        assert scene.truth(SUN, 0).visible is visible


def test_earth_is_seen_while_any_of_it_is_in_the_field() -> None:
    for theta, visible in ((158.0, True), (159.0, False)):
        assert EarthSunScene.facing(nadir_deg=(theta, 0)).truth(NADIR, 0).visible is visible


def test_scene_from_a_file(tmp_path: Path) -> None:
    scene = load_earth_sun_scene(
        save(
            tmp_path,
            """
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
            """,
        )
    )
    truth = scene.truth(NADIR, 0)
    assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((10, -20))
    np.testing.assert_allclose(scene.sun, [0, 0.6, -0.8])
    assert scene.moon is not None
    np.testing.assert_allclose(scene.moon, [1, 0, 0])
    np.testing.assert_allclose(scene.nadir_camera.matrix[2], [1, 0, 0])
    assert scene.reflections == (Reflection(SUN, 20.0, -10.0, 4.0, 200.0),)
    assert (scene.altitude_km, scene.bloom_px, scene.unevenness) == (600, 6.5, 0.2)
    assert (scene.glow_km, scene.hot_pixels, scene.hot_pairs) == (0, 5, 2)
    assert (scene.noise, scene.seed) == (False, 9)
    assert tuple(np.asarray(scene.rate_deg_s)) == (0, 0.1, 0)


def test_shortest_file(tmp_path: Path) -> None:
    scene = load_earth_sun_scene(save(tmp_path, 'kind = "earth-sun"'))
    assert scene.altitude_km == 750
    assert scene.moon is None


KIND = 'kind = "earth-sun"\n'


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", 'kind must be "earth-sun" for a sun and nadir sensor, not None'),
        ('kind = "sky"', "not 'sky'"),
        ("kind", "is no TOML file"),
        (f"{KIND}height = 3", "unknown key 'height'; allowed are nadir, nadir_deg"),
        (f"{KIND}sun = [1, 0, 0]\nsun_deg = [1, 0]", "give either sun or sun_deg, not both"),
        (f"{KIND}nadir = [0, 0, 0]", "nadir must be 3 numbers, not all 0, not (0.0, 0.0, 0.0)"),
        (f"{KIND}moon = [0, 0, nan]", "moon must be 3 numbers, not all 0"),
        (f"{KIND}nadir_deg = [1]", "nadir_deg must be a list of 2 numbers, not [1]"),
        (f"{KIND}altitude_km = 0", "altitude_km must be above 0, not 0.0"),
        (f"{KIND}bloom_px = -1", "bloom_px must be above 0, not -1.0"),
        (f"{KIND}unevenness = -0.1", "unevenness must not be negative, not -0.1"),
        (f"{KIND}hot_pairs = -3", "hot_pairs must not be negative, not -3"),
        (f"{KIND}seed = 0.5", "seed must be a whole number, not 0.5"),
        (f"{KIND}noise = 0", "noise must be true or false, not 0"),
        (f"{KIND}rate_deg_s = [inf, 0, 0]", "rate_deg_s must be 3 numbers in deg/s, not (inf"),
        (f"{KIND}sun_camera = 3", "sun_camera must be a table, not 3"),
        (f"{KIND}[sun_camera]\nright = [1, 0, 0]", "sun_camera: needs the key boresight"),
        (f"{KIND}[sun_camera]\nboresight = [1, 0, 0]", "sun_camera: right must not be along the"),
        (f"{KIND}[sun_camera]\nup = 1", "sun_camera: unknown key 'up'; allowed are boresight"),
        (f"{KIND}reflections = 1", "reflections must be tables, each under [[reflections]]"),
        (f'{KIND}[[reflections]]\ncamera = "star"', "camera must be one of ['sun', 'nadir']"),
        (f'{KIND}[[reflections]]\ncamera = "sun"', "needs the keys at_deg, level, radius_px"),
        (
            f'{KIND}[[reflections]]\ncamera = "sun"\nat_deg = [90, 90]\nlevel = 1\nradius_px = 1',
            "at_deg must be within 95.0 deg of the boresight, not 90.0, 90.0",
        ),
        (
            f'{KIND}[[reflections]]\ncamera = "sun"\nat_deg = [9, 9]\nlevel = 0\nradius_px = 1',
            "level must be above 0, not 0.0",
        ),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path: Path, text: str, complaint: str) -> None:
    path = save(tmp_path, text)
    with pytest.raises(SceneError) as caught:
        load_earth_sun_scene(path)
    message = str(caught.value)
    assert complaint in message
    assert str(path) in message
    assert "\n" not in message
