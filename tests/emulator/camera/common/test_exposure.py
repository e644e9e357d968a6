from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from cubestack.emulator.camera.common import exposure, imager
from cubestack.emulator.camera.common.exposure import (
    FAINTEST_V,
    camera_state_for,
    star_light,
    star_pixels,
)
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412.imager import DN12_PER_DN8, ELECTRONS_PER_DN12, IDEAL
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.light.pixels import grey_values
from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.picture import PictureScene
from cubestack.emulator.scene.sky import Pose, SkyScene
from cubestack.host.pictures.images import save_picture
from tests.tiers import quick

LINE = Fraction(132_200_000)
LONG = RollingShutter(10**12, LINE, 2917, 2917)
VEGA = 91262
SKY = load_sky(2026.0)
ORION = replace(SkyScene.pointing(83.8, -1.0), mag_limit=3.8)


def test_exposure_phases_0_and_1_are_its_begin_and_end() -> None:
    begin, middle, end = (exposure._time_ps(LENS, LONG, phase) for phase in (0.0, 0.5, 1.0))
    assert middle == LONG.mid_exposure_ps((LENS.rows - 1) / 2)
    assert end - middle == middle - begin == pytest.approx(LONG.exposure_s * 1e12 / 2)


def light(scene: SkyScene, shutter: RollingShutter = LONG, lens: Optics = LENS) -> np.ndarray:
    return star_light(scene, lens, shutter)


@pytest.mark.parametrize(
    "lens", [LENS, double_gauss(), double_gauss(40.0, shade=False), replace(LENS, psf_sigma_px=9.0)]
)
def test_stars_that_are_not_projected_cast_no_light(
    lens: Optics, monkeypatch: pytest.MonkeyPatch
) -> None:
    skies = [SkyScene(one) for one in np.random.default_rng(5).standard_normal((2, 4))]
    found = [light(sky, LONG, lens) for sky in skies]
    monkeypatch.setattr(Optics, "may_meet", lambda _self, vectors, _px: np.ones(len(vectors), bool))
    np.testing.assert_array_equal([light(sky, LONG, lens) for sky in skies], found)


def star(hip: int) -> np.ndarray:
    return SKY.vectors[np.searchsorted(SKY.hip, hip)].copy()


def magnitude(hip: int) -> float:
    return float(SKY.v_mag[np.searchsorted(SKY.hip, hip)])


def vega_at(pixel: tuple[float, float], time_s: float, rate: tuple[float, ...]) -> SkyScene:
    """Only Vega, which ``time_s`` puts on ``pixel`` while the camera turns."""
    target = LENS.unproject(np.array([pixel]))[0]
    turn, _ = Rotation.align_vectors([target], [star(VEGA)])
    start = Rotation.from_rotvec(np.radians(rate) * time_s) * turn
    return SkyScene(start.as_quat(), rate, mag_limit=0.1)


def light_around(image: np.ndarray, x: float, y: float, half: int = 12) -> tuple[float, np.ndarray]:
    row, column = round(y), round(x)
    box = image[row - half : row + half + 1, column - half : column + half + 1].astype(float)
    rows, columns = np.mgrid[row - half : row + half + 1, column - half : column + half + 1]
    total = box.sum()
    return total, np.array([(box * columns).sum(), (box * rows).sum()]) / total


def brute_force(scene: SkyScene, shutter: RollingShutter, instants: int) -> np.ndarray:
    """Vega's light, every row integrated over its own exposure, pixel by pixel."""
    image = np.zeros((512, 1024))
    electrons = LENS.electrons_per_second(magnitude(VEGA)) * shutter.exposure_s / instants
    start = Rotation.from_quat(np.asarray(scene.quaternion))
    for row in range(512):
        end = shutter.readout_ps / 1e12 + row * shutter.line_s
        times = end - shutter.exposure_s * (np.arange(instants) + 0.5) / instants
        turns = Rotation.from_rotvec(-np.radians(scene.rate_deg_s) * times[:, None]) * start
        x, y = LENS.project(turns.apply(star(VEGA))).T
        sigma = LENS.psf_sigma_px
        down = ndtr((row + 0.5 - y) / sigma) - ndtr((row - 0.5 - y) / sigma)
        if down.max() < 1e-9:
            continue
        edges = (np.arange(1025)[:, None] - 0.5 - x) / sigma
        image[row] = (np.diff(ndtr(edges), axis=0) * down).sum(axis=1) * electrons
    return image


def test_star_pixels_equal_scipy_rotation_and_lens_projection() -> None:
    scene = replace(SkyScene.pointing(83.8, -1.0, 40.0), mag_limit=3.0)
    hips, pixels = star_pixels(scene, LENS, LONG)
    axes = Rotation.from_quat(np.asarray(scene.quaternion))
    assert {24436, 26311, 25336} <= set(hips)  # Rigel, Alnilam, Bellatrix
    for hip, pixel in zip(hips, pixels, strict=True):
        expected = LENS.project(axes.apply(star(hip))[None])[0]
        np.testing.assert_allclose(pixel, expected, atol=1e-9)


def test_orion_appears_upright() -> None:
    hips, pixels = star_pixels(ORION, LENS, LONG)
    place = dict(zip(hips, pixels, strict=True))
    rigel, betelgeuse, bellatrix = place[24436], place[27989], place[25336]
    assert betelgeuse[1] < rigel[1]  # north is up
    assert betelgeuse[0] < bellatrix[0]  # east is left


def test_light_of_a_star_is_complete_and_centred() -> None:
    scene = replace(SkyScene.pointing(83.8, -1.0, 40.0), mag_limit=1.0)
    image = light(scene)
    assert (image.shape, image.dtype) == ((512, 1024), np.float32)
    hips, pixels = star_pixels(scene, LENS, LONG)
    assert len(hips) >= 2
    for hip, (x, y) in zip(hips, pixels, strict=True):
        total, centroid = light_around(image, x, y)
        expected = LENS.electrons_per_second(magnitude(hip)) * LONG.exposure_s
        assert total == pytest.approx(expected, rel=1e-5)
        np.testing.assert_allclose(centroid, (x, y), atol=1e-4)


def test_star_spot_is_a_pixel_integrated_gaussian_of_the_psf_width() -> None:
    scene = vega_at((400.3, 200.8), 0.0, (0, 0, 0))
    np.testing.assert_allclose(light(scene), brute_force(scene, LONG, 1), atol=0.3)
    assert light(scene).max() > 50_000
    x = np.arange(1024)
    for sigma in (0.9, 2.5):
        image = light(scene, lens=replace(LENS, psf_sigma_px=sigma))
        columns = image.sum(axis=0).astype(float)
        variance = np.average((x - 400.3) ** 2, weights=columns)
        assert variance == pytest.approx(sigma**2 + 1 / 12, rel=1e-3)  # the pixel's own width


# By the first rate the star sinks, with the read-out.
@pytest.mark.parametrize(
    "rate",
    quick(map(pytest.param, [(2, 0, 0), (-2, 0, 0), (1.0, 0.7, 5.0), (0, -2, 0), (0, 0, 6)]), 2),
)
def test_star_streak_equals_brute_force(rate: tuple[float, ...]) -> None:
    # Long lines make the rolling shutter plain to see.
    shutter = RollingShutter(2 * 10**12, 4 * LINE, 700, 700)
    scene = vega_at((800.0, 430.0), 1.9, rate)
    expected = brute_force(scene, shutter, 400)
    found = light(scene, shutter)
    assert found.sum() == pytest.approx(expected.sum(), rel=2e-3)
    assert np.abs(found - expected).max() < 0.02 * expected.max()


def test_rolling_shutter_shifts_lower_rows_later() -> None:
    # Turning about y by 1 deg/s moves stars 20 px/s along x; row 511 is 67.6 ms after row 0.
    early = replace(LONG, readout_ps=0)
    scenes = [vega_at((539.0, row), 0.0, (0, 1.0, 0)) for row in (20.0, 490.0)]
    top, bottom = (star_pixels(scene, LENS, early)[1][0] for scene in scenes)
    # Both were on column 539 at time 0; the exposure of the bottom row is 470 lines later.
    speed = -np.radians(1) * 6.28 / 0.0056
    assert bottom[0] - top[0] == pytest.approx(speed * 470 * 132.2e-6, rel=0.2)
    assert abs(bottom[0] - top[0]) > 1


def test_rolling_shutter_stretches_streaks_that_move_with_it() -> None:
    # A star that moves down by v px a line is seen by rows that are exposed later and later.
    shutter = RollingShutter(10**12, 20 * LINE, 100, 100)

    def height(rate: float) -> float:
        columns = light(vega_at((539.0, 175.5), 0.9, (rate, 0, 0)), shutter).sum(axis=1)
        y = np.arange(512)
        mean = np.average(y, weights=columns)
        return float(np.sqrt(12 * np.average((y - mean) ** 2, weights=columns)))

    down, up = height(4.0), height(-4.0)
    per_line = np.radians(4) * 6.28 / 0.0056 * shutter.line_s
    assert down / up == pytest.approx((1 + per_line) / (1 - per_line), rel=0.02)


def test_static_scene_does_not_depend_on_time() -> None:
    later = replace(LONG, readout_ps=7 * 10**14)
    np.testing.assert_array_equal(light(ORION), light(ORION, later))


def test_exposure_uses_the_pose_at_its_time() -> None:
    poses = (Pose(ORION.quaternion, at_s=5.0),)
    scene = replace(SkyScene.pointing(10.0, 20.0), poses=poses, mag_limit=3.8)
    late = replace(LONG, readout_ps=6 * 10**12)
    np.testing.assert_allclose(light(scene, late), light(ORION, late), atol=1e-2)
    assert np.abs(light(scene) - light(ORION)).max() > 1000


def test_stars_at_the_magnitude_limits_have_the_expected_counts() -> None:
    # A V 3.8 star: about 300 counts of 8 bits in the default exposure; V 8: below one at its peak.
    hip = int(SKY.hip[np.abs(SKY.v_mag - 3.8).argmin()])
    x, y, z = star(hip)
    dec, ra = np.degrees(np.arcsin(z)), np.degrees(np.arctan2(y, x))
    scene = replace(SkyScene.pointing(ra, dec), mag_limit=3.81)
    total, _ = light_around(grey_values(light(scene), IDEAL), 539, 175, half=5)
    assert 275 < total < 301  # truncation to whole counts takes some
    peak = LENS.electrons_per_second(FAINTEST_V) * LONG.exposure_s * 0.39**2 / 0.81
    assert peak / ELECTRONS_PER_DN12 / DN12_PER_DN8 < 1.3


def test_magnitude_limit_excludes_fainter_stars() -> None:
    scenes = [replace(ORION, mag_limit=limit) for limit in (3.0, 3.8, 6.0, None)]
    few, some, many, most = (len(star_pixels(scene, LENS, LONG)[0]) for scene in scenes)
    assert 5 < few < some < many < most
    assert light(replace(ORION, mag_limit=-5)).max() == 0


def test_false_stars_add_light_and_repeat_with_the_seed() -> None:
    empty = replace(SkyScene.pointing(0.0, 0.0), mag_limit=-5, seed=4)
    one, five, again, other = (
        light(replace(empty, false_stars=number, seed=seed)).astype(float)
        for number, seed in ((1, 4), (5, 4), (5, 4), (5, 5))
    )
    assert (one > 0).sum() < 400
    np.testing.assert_array_equal(five, again)
    assert np.abs(five - other).max() > 100
    brightest, faintest = LENS.electrons_per_second(empty.false_star_mag) * LONG.exposure_s
    assert 5 * faintest < five.sum() < 5 * brightest


def test_light_scales_with_aperture_area_and_vignetting() -> None:
    scene = vega_at((30.0, 480.0), 0.0, (0, 0, 0))
    dimmed = light(scene, lens=replace(LENS, vignetting=4.0))
    wide = light(scene, lens=replace(LENS, aperture_mm=2 * LENS.aperture_mm))
    np.testing.assert_allclose(wide, 4 * light(scene), rtol=1e-5)
    off_axis = LENS.unproject(np.array([[30.0, 480.0]]))[0, 2]
    assert dimmed.sum() / light(scene).sum() == pytest.approx(off_axis**4, rel=1e-5)


def test_published_centroiding_error_of_18_noise_free_stars() -> None:
    # CubeStar thesis, section 4.1.6: 0.0244 px along x, 0.0427 px along y, mean.
    scene = replace(SkyScene.pointing(0.0, 0.0), mag_limit=-5, false_stars=18)
    errors = []
    for seed in range(20):
        lights = replace(scene, seed=seed)
        places = lights.false_lights()[0] * [1023, 511]
        counts = grey_values(light(lights), IDEAL).astype(float)
        apart = np.linalg.norm(places[:, None] - places, axis=2) + 100 * np.eye(18)
        inside = np.all((places > 8) & (places < (1015, 503)), axis=1) & (apart.min(axis=1) > 16)
        for x, y in places[inside]:
            row, column = round(y), round(x)
            box = counts[row - 1 : row + 2, column - 1 : column + 2]
            dy, dx = np.divmod(int(box.argmax()), 3)
            _, centroid = light_around(counts, column + dx - 1, row + dy - 1, half=2)
            errors.append(np.abs(centroid - (x, y)))
    assert len(errors) > 200
    assert np.all(np.mean(errors, axis=0) <= (0.0244, 0.0427))


def test_sky_glow_adds_uniformly_to_the_stars() -> None:
    clear = Atmosphere(-1, 83.8, seeing_arcsec=0, scintillation=False, extinction_mag=0)
    dark = replace(ORION, atmosphere=clear)
    bright = replace(ORION, atmosphere=replace(clear, sky_mag=20.0))
    glow = light(bright) - light(dark)
    # A square arcsecond like a star of 20 mag, 184 x 184 of them a pixel.
    per_pixel = LENS.electrons_per_second(20.0) * (206264.8 * 0.0056 / 6.28) ** 2
    np.testing.assert_allclose(glow, per_pixel * LONG.exposure_s, rtol=1e-4)
    shaded = light(bright, LONG, double_gauss()) - light(dark, LONG, double_gauss())
    assert shaded[512, 640] > 0
    assert shaded[10, 10] == 0
    # Only refraction is left, and the light of stars 60 deg high.
    np.testing.assert_allclose(light(dark).sum(), light(ORION).sum(), rtol=0.02)
    hazy = light(replace(ORION, atmosphere=replace(clear, extinction_mag=2.5)))
    # A tenth at the zenith, less at 60 deg.
    assert 0.08 < hazy.sum() / light(dark).sum() < 0.1


def test_air_differs_per_exposure_and_seed() -> None:
    air = replace(ORION, atmosphere=Atmosphere(0, 84))
    later = replace(LONG, readout_ps=2 * 10**12)
    np.testing.assert_array_equal(light(air), light(air))
    assert np.abs(light(air, later) - light(air)).max() > 100
    assert np.abs(light(replace(air, seed=5)) - light(air)).max() > 100


def test_static_stars_do_not_streak() -> None:
    scene = vega_at((600.0, 200.0), LONG.mid_exposure_ps(255.5) / 1e12, (0.0, 4.0, 0.0))
    still = light(replace(scene, still=True, mag_limit=0.1))
    y, x = np.unravel_index(still.argmax(), still.shape)
    assert (x, y) == (600, 200)
    assert still.max() > 10 * light(replace(scene, mag_limit=0.1)).max()


def test_field_angles_are_those_of_the_image_edges() -> None:
    """Half a pixel beyond the outermost pixels' centres."""
    now = camera_state_for([0, 0, 0, 1], LENS)
    ends = {
        "width_deg": [[-0.5, 255.5], [1023.5, 255.5]],
        "height_deg": [[511.5, -0.5], [511.5, 511.5]],
    }
    for name, places in ends.items():
        one, other = LENS.unproject(np.array(places))
        assert getattr(now, name) == pytest.approx(np.degrees(np.arccos(one @ other)), abs=1e-9)
    np.testing.assert_allclose(now.axes, np.eye(3), atol=1e-15)


def test_photograph_brightness_is_proportional_to_exposure(tmp_path: Path) -> None:
    pixels = np.array([[0, 1, 100, 127, 128, 255]], np.uint8)
    save_picture(pixels, tmp_path / "sky.png")
    scene = PictureScene(tmp_path / "sky.png", exposure_ms=500 * LONG.exposure_s)
    found = imager._photograph(scene, pixels, LONG)
    assert found.tolist() == [[0, 2, 200, 254, 255, 255]]
