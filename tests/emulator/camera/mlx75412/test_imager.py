from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

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
    first = picture(ORION)
    assert np.any(first != picture(ORION, condition=replace(CONDITION, seed=1)))
    assert np.any(first != picture(ORION, replace(LONG, readout_ps=2 * 10**12)))
    imager = Mlx75412Imager(seed=2)  # whatever else was rendered
    imager.picture(ORION, CONDITION, replace(LONG, readout_ps=5), Corrections())
    np.testing.assert_array_equal(imager.picture(ORION, CONDITION, LONG, Corrections()), first)


def test_without_noise_only_light_is_left() -> None:
    quiet = picture(ORION, condition=replace(CONDITION, noise=False, temperature_c=65))
    np.testing.assert_array_equal(quiet, ideal_counts(star_light(ORION, LENS, LONG)))
    assert quiet.flags.c_contiguous


def test_hot_pixels_come_from_the_condition() -> None:
    dark = replace(ORION, mag_limit=-5)
    assert picture(dark, condition=replace(CONDITION, hot_pixels=0)).max() < 6
    assert np.sum(picture(dark, condition=replace(CONDITION, hot_pixels=100)) > 6) > 50


@pytest.mark.parametrize(
    ("lines", "programmed", "scale"),
    [(2917, 2917, 1.0), (100, 100, 1.0), (1000, 2000, 0.5), (2000, 1000, 2.0)],
)
def test_photograph_is_light_as_it_is_but_scales_in_the_undefined_frame(
    striped: PictureScene, lines: int, programmed: int, scale: float
) -> None:
    shutter = replace(LONG, exposure_lines=lines, programmed_lines=programmed)
    expected = np.minimum(striped.pixels * scale // 1, 255)
    np.testing.assert_array_equal(picture(striped, shutter), expected)


def test_photograph_with_a_known_exposure_scales(striped: PictureScene) -> None:
    known = replace(striped, exposure_ms=LONG.exposure_s * 2000)
    np.testing.assert_allclose(picture(known), striped.pixels // 2, atol=1)
