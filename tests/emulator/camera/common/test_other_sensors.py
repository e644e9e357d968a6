"""Lens, light, scenes and registers with a sensor that is not CubeStar's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.common.exposure import star_light, star_pixels
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.photometry import electrons_per_second
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.lens import aramis_lens
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import PictureScene, SceneError, SkyScene, load_scene
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS

ORION = quaternion_from_pointing(84.0, -1.0, 0.0)
SHUTTER = RollingShutter(10**12, 31_750_000, 3000, 3000)  # type: ignore[arg-type]


def test_light_has_the_sensor_s_size_and_falls_where_the_stars_are() -> None:
    scene = SkyScene(ORION, optics=aramis_lens())
    light = star_light(scene, SHUTTER)
    assert light.shape == (1024, 1280)
    hip, pixels = star_pixels(scene, SHUTTER)
    x, y = np.rint(pixels[list(hip).index(24436)]).astype(int)  # Rigel
    assert light[y - 1 : y + 2, x - 1 : x + 2].max() == light.max()


def test_electrons_go_with_the_aperture_s_area_and_the_width() -> None:
    usual = electrons_per_second(3.0)
    assert electrons_per_second(3.0, 10.0) == pytest.approx(4 * usual)
    assert electrons_per_second(3.0, 5.0, 9560.0) == pytest.approx(2 * usual)
    scene = SkyScene(ORION, optics=aramis_lens())
    lens = scene.optics
    wide = replace(scene, optics=replace(lens, aperture_mm=2 * lens.aperture_mm))
    np.testing.assert_allclose(star_light(wide, SHUTTER), 4 * star_light(scene, SHUTTER), rtol=1e-5)


def test_the_shade_keeps_stars_beyond_the_field_away() -> None:
    open_field = SkyScene(ORION, optics=aramis_lens(shade=False))
    shaded = SkyScene(ORION, optics=aramis_lens())
    y, x = np.mgrid[:1024, :1280]
    outside = np.hypot(x - 639.5, y - 511.5) > 530
    assert star_light(open_field, SHUTTER)[outside].sum() > 0
    assert star_light(shaded, SHUTTER)[outside].sum() == 0


def test_a_scene_file_changes_the_device_s_lens_and_keeps_the_sensor(tmp_path: Path) -> None:
    path = tmp_path / "sky.toml"
    path.write_text(
        'kind = "sky"\nra_deg = 84\ndec_deg = -1\n[optics]\npsf_sigma_px = 2.5\n', encoding="utf-8"
    )
    lens = aramis_lens()
    scene = load_scene(path, lens)
    assert isinstance(scene, SkyScene)
    assert scene.optics == replace(lens, psf_sigma_px=2.5)
    usual = load_scene(path)
    assert isinstance(usual, SkyScene)
    assert usual.optics == replace(Optics(), psf_sigma_px=2.5)
    path.write_text(path.read_text(encoding="utf-8") + "columns = 5\n", encoding="utf-8")
    with pytest.raises(SceneError, match="columns"):
        load_scene(path)


def test_a_picture_of_the_sensor_s_size(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (1100, 1300), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "sky.png")
    scene = PictureScene(tmp_path / "sky.png", crop=(20, 76), size=(1280, 1024))
    np.testing.assert_array_equal(scene.pixels, pixels[76:, 20:])
    with pytest.raises(SceneError, match="at least 1301 x 1024"):
        PictureScene(tmp_path / "sky.png", crop=(21, 0), size=(1280, 1024))


def test_more_hot_pixels_than_the_sensor_has_are_refused() -> None:
    pixels = 1280 * 1024
    SkyScene(ORION, optics=aramis_lens(), hot_pixels=pixels)
    with pytest.raises(SceneError, match=str(pixels)):
        SkyScene(ORION, optics=aramis_lens(), hot_pixels=pixels + 1)


@pytest.mark.parametrize("name", ["columns", "rows", "aperture_mm", "field_stop_deg"])
def test_a_lens_without_sensor_aperture_or_field_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be above 0"):
        replace(aramis_lens(), **{name: 0})


def test_registers_of_sixteen_bits_behind_one_address() -> None:
    registers = RegisterFile(REGISTERS)
    registers.select(0x09)
    assert registers.read() == 0x0419
    registers.select(0x09)
    assert registers.write(0xBEEF) is REGISTERS["SHUTTER_WIDTH"]
    assert registers.active("SHUTTER_WIDTH") == 0xBEEF
    registers.store("CHIP_VERSION", 0x1234)
    assert registers.active("CHIP_VERSION") == 0x1234
    assert REGISTERS["SHUTTER_WIDTH"].units(0xBEEF) == [0xBEEF]
