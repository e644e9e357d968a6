from dataclasses import replace
from fractions import Fraction

import numpy as np

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412.imager import Corrections, Mlx75412Imager, ideal_counts
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.sky import PictureScene, SkyScene

LONG = RollingShutter(10**12, Fraction(132_200_000), 2917, 2917)
ORION = replace(SkyScene.pointing(83.8, -1.0), mag_limit=3.8)


def picture(
    scene: SkyScene | PictureScene,
    shutter: RollingShutter = LONG,
    condition: SkyCondition = CONDITION,
) -> np.ndarray:
    return Mlx75412Imager(seed=2).picture(scene, condition, shutter, Corrections())


def test_noise_repeats_for_the_same_scene_and_frame_only() -> None:
    np.testing.assert_array_equal(picture(ORION), picture(ORION))
    assert np.any(picture(ORION) != picture(ORION, condition=replace(CONDITION, seed=1)))
    assert np.any(picture(ORION) != picture(ORION, replace(LONG, readout_ps=2 * 10**12)))


def test_noise_does_not_depend_on_frames_that_were_not_rendered() -> None:
    imager = Mlx75412Imager(seed=2)
    imager.picture(ORION, CONDITION, replace(LONG, readout_ps=5), Corrections())
    again = imager.picture(ORION, CONDITION, LONG, Corrections())
    np.testing.assert_array_equal(again, picture(ORION))


def test_without_noise_only_light_is_left() -> None:
    quiet = picture(ORION, condition=replace(CONDITION, noise=False, temperature_c=65))
    np.testing.assert_array_equal(quiet, ideal_counts(star_light(ORION, LENS, LONG)))
    assert quiet.flags.c_contiguous


def test_hot_pixels_come_from_the_condition() -> None:
    dark = replace(ORION, mag_limit=-5)
    assert picture(dark, condition=replace(CONDITION, hot_pixels=0)).max() < 6
    assert np.sum(picture(dark, condition=replace(CONDITION, hot_pixels=100)) > 6) > 50


def test_photograph_is_light_as_it_is(striped: PictureScene) -> None:
    np.testing.assert_array_equal(picture(striped), striped.pixels)
    short = replace(LONG, exposure_lines=100, programmed_lines=100)
    np.testing.assert_array_equal(picture(striped, short), striped.pixels)


def test_photograph_in_the_undefined_frame_scales(striped: PictureScene) -> None:
    half = picture(striped, replace(LONG, exposure_lines=1000, programmed_lines=2000))
    np.testing.assert_array_equal(half, striped.pixels // 2)
    double = picture(striped, replace(LONG, exposure_lines=2000, programmed_lines=1000))
    np.testing.assert_array_equal(double, np.minimum(striped.pixels.astype(int) * 2, 255))


def test_photograph_with_a_known_exposure_scales(striped: PictureScene) -> None:
    known = replace(striped, exposure_ms=LONG.exposure_s * 2000)
    np.testing.assert_allclose(picture(known), striped.pixels // 2, atol=1)
