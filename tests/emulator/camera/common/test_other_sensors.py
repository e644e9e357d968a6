"""Light and registers with a sensor that is not CubeStar's."""

import numpy as np

from cubestack.emulator.camera.common.exposure import star_light, star_pixels
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS

ORION = SkyScene.pointing(84.0, -1.0)
LENS = double_gauss()
SHUTTER = RollingShutter(10**12, 31_750_000, 3000, 3000)


def test_light_has_the_sensor_s_size_and_falls_where_the_stars_are() -> None:
    light = star_light(ORION, LENS, SHUTTER)
    assert light.shape == (1024, 1280)
    hip, pixels = star_pixels(ORION, LENS, SHUTTER)
    x, y = np.rint(pixels[list(hip).index(24436)]).astype(int)  # Rigel
    assert light[y - 1 : y + 2, x - 1 : x + 2].max() == light.max()


def test_the_shade_keeps_stars_beyond_the_field_away() -> None:
    y, x = np.mgrid[:1024, :1280]
    outside = np.hypot(x - 639.5, y - 511.5) > 530
    assert star_light(ORION, double_gauss(shade=False), SHUTTER)[outside].sum() > 0
    assert star_light(ORION, LENS, SHUTTER)[outside].sum() == 0


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
