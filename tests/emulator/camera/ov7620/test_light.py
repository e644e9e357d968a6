from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import LENSES, undistort
from cubestack.emulator.camera.ov7620.light import USUAL_EXPOSURE, scene_light
from cubestack.emulator.camera.ov7620.luminance import BLACK, luminance, stuck_pixels
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Mounting, Reflection
from cubestack.emulator.scene.hazards import Ghosts, Glint, Moon
from cubestack.emulator.scene.hazards.contract import EARTH_RADIANCE
from cubestack.emulator.scene.hazards.glint import SUN_SURFACE
from cubestack.firmware_model.interface.cameras.ov7620 import EXPOSURE_LINES

SUN, NADIR = CameraTarget.SUN, CameraTarget.NADIR
ROWS, COLUMNS = np.mgrid[:480, :640]
DOWN = Mounting([0, 0, 1])


def levels(scene: EarthSunScene, camera: CameraTarget, bloom_px: float = 7.0) -> np.ndarray:
    """Grey values at the exposure of the published levels, without noise and without a limit."""
    lines = USUAL_EXPOSURE[camera] * EXPOSURE_LINES
    return BLACK + scene_light(scene, camera, bloom_px, 0) * lines


def noon(scene: EarthSunScene) -> EarthSunScene:
    """The same with the Sun in the zenith below the satellite."""
    return replace(scene, sun=-np.asarray(scene.nadir))


def radius(camera: CameraTarget) -> np.ndarray:
    return np.hypot(COLUMNS - LENSES[camera].cx, ROWS - LENSES[camera].cy)


def bright(picture: np.ndarray, threshold: float = 99) -> tuple[float, np.ndarray]:
    """Radius of a circle as large as all that is brighter, and its centre."""
    y, x = np.nonzero(picture >= threshold)
    return float(np.sqrt(len(x) / np.pi)), np.array([x.mean(), y.mean()])


def test_full_earth_has_the_published_levels() -> None:
    picture = levels(EarthSunScene(unevenness=0), NADIR)
    assert picture[radius(NADIR) < 170].mean() == pytest.approx(153, abs=0.5)
    assert np.all(picture[radius(NADIR) > 175] == 34)


def test_limb_is_63_48_deg_from_the_nadir_all_around() -> None:
    tilted = noon(EarthSunScene.facing(nadir_deg=(20, 15), unevenness=0, glow_km=0))
    picture = levels(tilted, NADIR)
    # The limb is a little darker than the middle, as the Sun is lower there.
    inside = picture - 34 > 0.895 * 120.4 / 2
    y, x = np.nonzero(inside[:, 1:] != inside[:, :-1])
    assert len(x) > 300
    edges = LENSES[NADIR].unproject(np.stack([x + 0.5, y], axis=1))
    angles = np.degrees(np.arccos(edges @ tilted.truth(NADIR, 0).vector))
    # Half a pixel is a sixth of a degree in the middle and a third at the rim.
    assert np.abs(angles - 63.48).max() < 0.35
    assert angles.mean() == pytest.approx(63.48, abs=0.02)


def test_pixels_beyond_the_lens_rim_are_black() -> None:
    picture = levels(noon(EarthSunScene.facing(nadir_deg=(70, 0))), NADIR)
    assert np.all(picture[radius(NADIR) > 227.2] == 34)
    assert np.all(picture[(radius(NADIR) < 226) & (ROWS == 236) & (COLUMNS > 400)] > 100)
    # A pixel that the rim crosses has a part of the light of the one inside.
    lens = LENSES[NADIR]
    share = lens.field.lit[np.searchsorted(lens.field.index, 236 * 640 + 371 + 227)]
    assert 0 < share < 0.2
    part, whole = picture[236, 371 + 227] - 34, picture[236, 371 + 226] - 34
    assert part == pytest.approx(share * whole, rel=0.05)


def test_night_side_is_dark_and_the_terminator_divides_the_image() -> None:
    assert levels(EarthSunScene(sun=(0, 0, 1)), NADIR).max() < 34.5
    picture = levels(EarthSunScene(sun=(1, 0, 0), sun_camera=DOWN, unevenness=0), NADIR)
    row = picture[236]
    assert row[371 - 168 : 371 - 30].max() < 36
    assert row[371 + 160] > 60
    # The Sun itself is in the picture too: without a filter, a large saturated spot.
    assert bright(np.where(COLUMNS > 371 + 180, picture, 0), 255)[0] > 10


@pytest.mark.parametrize("bloom_px", [4.0, 6.0, 7.0, 8.0])
def test_sun_has_the_requested_size_on_the_boresight(bloom_px: float) -> None:
    picture = levels(EarthSunScene(), SUN, bloom_px)
    size, centre = bright(picture)
    assert size == pytest.approx(bloom_px, abs=0.25)
    np.testing.assert_allclose(centre, [369, 250], atol=1e-9)
    assert picture.max() > 255
    assert picture[0, 0] == 34


def test_sun_image_lies_in_its_direction() -> None:
    generator = np.random.default_rng(2)
    for alpha, beta in generator.uniform(-60, 60, (20, 2)):
        light = levels(EarthSunScene.facing((alpha, beta)), SUN) - 34
        centre = [np.average(axis, weights=light) for axis in (COLUMNS, ROWS)]
        offset = np.array(centre) - (369, 250)
        theta = undistort(np.hypot(*offset)) / 2.9
        np.testing.assert_allclose(offset / np.hypot(*offset) * theta, [alpha, beta], atol=0.01)


def test_sun_image_shrinks_towards_the_rim_and_is_cut_by_the_sensor() -> None:
    size, _ = bright(levels(EarthSunScene.facing((90, 0)), SUN, 8.0))
    assert size == pytest.approx(6, abs=0.3)
    # 94 deg down is below the sensor's last row: the sun camera's field is cut there.
    picture = levels(EarthSunScene.facing((0, 94)), SUN)
    assert np.nonzero(picture > 99)[0].min() > 465
    assert picture.shape == (480, 640)


def test_sun_camera_images_neither_earth_nor_hidden_sun() -> None:
    picture = levels(EarthSunScene.facing((94, 0), (0, 0), sun_camera=DOWN), SUN)
    assert picture[radius(SUN) < 160].max() < 34.1
    behind = EarthSunScene.facing((30, 0), sun_camera=DOWN)
    assert levels(behind, SUN).max() < 34.1
    assert levels(EarthSunScene.facing((96, 0)), SUN).max() == pytest.approx(34, abs=0.1)


def test_moon_is_small_and_has_phases() -> None:
    def moon(sun: tuple[float, float, float]) -> float:
        picture = levels(EarthSunScene(sun=sun, moon=(1, 0, 0), nadir=(-1, 0, 0)), NADIR)
        return float((picture - 34)[226:247, 582:603].sum())

    full = moon((-0.999, 0.04, 0))
    # Allen: V = -12.73 full and -10.1 half; 4.75e9 stars a steradian are as bright as the Earth,
    # and at 90 deg a pixel covers 0.36 by 0.55 deg.
    stars, pixel_sr = 10 ** (0.4 * (12.73 - 0.026 * 2.3)), np.radians(0.3565) * np.radians(0.549)
    assert full == pytest.approx(120.4 * stars / pixel_sr / 4.75e9, rel=0.15)
    assert moon((0, 1, 0)) == pytest.approx(full * 10 ** (-0.4 * 2.54), rel=0.15)
    hidden = EarthSunScene(moon=(0, 0, 1))
    np.testing.assert_array_equal(levels(hidden, NADIR), levels(replace(hidden, moon=None), NADIR))


def test_reflection_is_a_uniform_disc_in_its_own_camera() -> None:
    ghost = Reflection(SUN, 20, -30, radius_px=6, level=180)
    scene = EarthSunScene.facing((40, 40), reflections=(ghost,))
    plain = replace(scene, reflections=())
    light = levels(scene, SUN) - levels(plain, SUN)
    assert light.max() == pytest.approx(180, rel=1e-4)
    assert light.sum() / light.max() == pytest.approx(np.pi * 36, rel=0.02)
    centre = LENSES[SUN].unproject([bright(light, 90)[1]])[0]
    assert np.degrees(np.arctan2(centre[1], centre[0])) == pytest.approx(-56.3, abs=0.5)
    np.testing.assert_array_equal(levels(scene, NADIR), levels(plain, NADIR))


def test_glint_brightness_follows_the_transmission_of_each_camera() -> None:
    """A patch of the radiance 1, in both cameras: published transmission 1e-4."""
    glint = Glint(surface=EARTH_RADIANCE / SUN_SURFACE, count=1, seed=4)
    dark = EarthSunScene(nadir=(0, 1, 0), sun=(0, 1, 0.1), hazards=(glint,))
    assert (levels(dark, NADIR) - 34)[radius(NADIR) < 226].max() == pytest.approx(120.4, rel=0.02)
    assert (levels(dark, SUN) - 34).max() < 120.4 / 4 * 1e-4
    mirror = replace(dark, hazards=(replace(glint, surface=1.0),))
    # The Sun's surface is 154 000 times as bright as the Earth; a fifth to all of the filter's.
    assert 90 < (levels(mirror, SUN) - 34).max() < 461


def test_earth_hides_bodies_behind_it_but_not_lens_reflections() -> None:
    behind = EarthSunScene(hazards=(Moon(direction=(0.0, 0.0, 1.0)),))
    plain = levels(replace(behind, hazards=()), NADIR)
    assert np.abs(levels(behind, NADIR) - plain).max() < 0.5  # what the lens would scatter
    patch = replace(behind, hazards=(Glint(),))
    assert (levels(patch, NADIR) - plain).max() > 100


def test_hazard_uses_the_scene_s_sun_by_default() -> None:
    scene = EarthSunScene.facing(nadir_deg=(70, 0), sun_deg=None, sun=(-0.5, 0.0, 1.0))
    ghosts = levels(replace(scene, hazards=(Ghosts(seed=2),)), NADIR)
    told = levels(replace(scene, hazards=(Ghosts(seed=2, sun=(-0.5, 0.0, 1.0)),)), NADIR)
    np.testing.assert_allclose(ghosts, told, rtol=1e-5)
    assert (ghosts - levels(scene, NADIR)).max() > 10
    night = replace(scene, sun=scene.nadir)
    dark = levels(replace(night, hazards=(Ghosts(),)), NADIR)
    np.testing.assert_array_equal(dark, levels(night, NADIR))


def test_image_shows_the_scene_at_its_time() -> None:
    scene = EarthSunScene(rate_deg_s=(0, 1.0, 0), unevenness=0)
    later = scene_light(scene, NADIR, 7.0, 10 * 10**12)
    expected = EarthSunScene.facing(nadir_deg=(-10, 0), unevenness=0)
    np.testing.assert_allclose(later, scene_light(noon(expected), NADIR, 7.0, 0), atol=0.02)


NONE = np.zeros(0, np.int64)


def flat(level: float) -> np.ndarray:
    return np.full((480, 640), level, np.float32)


def test_luminance_has_black_level_34_and_saturates() -> None:
    steps = flat(0)
    steps[0, :6] = [0.4, 0.6, 119, 220.4, 221, 1e6]
    grey = luminance(steps, 1.0, None, NONE)
    assert grey.dtype == np.uint8
    np.testing.assert_array_equal(grey[0, :7], [34, 35, 153, 254, 255, 255, 34])
    # Gain raises the light, and not the black level.
    assert np.all(luminance(flat(10), 3.5, None, NONE) == 34 + 35)
    assert np.all(luminance(flat(0), 7.75, None, NONE) == 34)


@pytest.mark.parametrize(
    ("light", "gain", "sigma"), [(0, 1, 0.7), (119, 1, 0.88), (200, 1, 0.98), (0, 4, 2.8)]
)
def test_noise_has_48_db_at_full_scale(light: float, gain: float, sigma: float) -> None:
    grey, same, other = (
        luminance(flat(light), gain, FrameNoise([seed]), NONE).astype(float) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(grey, same)
    assert np.any(grey != other)
    assert grey.mean() == pytest.approx(34 + light, abs=0.02)
    # Rounding to whole grey values adds a variance of 1/12.
    assert grey.std() == pytest.approx(np.hypot(sigma, 12**-0.5), rel=0.02)


def test_stuck_pixels_are_at_full_scale_and_each_camera_has_its_own() -> None:
    stuck = stuck_pixels(3, CameraTarget.SUN, 20, 10)
    grey = luminance(flat(0), 1.0, None, stuck)
    assert np.count_nonzero(grey == 255) == 40
    assert np.all(grey.ravel()[stuck] == 255)
    np.testing.assert_array_equal(stuck, stuck_pixels(3, CameraTarget.SUN, 20, 10))
    for other in (stuck_pixels(3, NADIR, 20, 10), stuck_pixels(4, SUN, 20, 10)):
        assert np.any(stuck != other)


def test_stuck_pixel_pairs_are_adjacent_and_never_triples() -> None:
    for seed in range(20):
        hot = np.zeros(480 * 640, bool)
        hot[stuck_pixels(seed, CameraTarget.NADIR, 300, 200)] = True
        rows = hot.reshape(480, 640).astype(int)
        pairs = rows[:, 1:] + rows[:, :-1] == 2
        triples = rows[:, 2:] + rows[:, 1:-1] + rows[:, :-2] == 3
        assert (rows.sum(), pairs.sum(), triples.sum()) == (700, 200, 0)
