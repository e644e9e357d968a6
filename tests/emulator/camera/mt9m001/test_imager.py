"""Windows of a turning sky are exposed at their own rows' times."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import SensorSettings, read_settings
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS

LINE_PS = Fraction(31_750_000)
WHOLE = replace(read_settings(RegisterFile(REGISTERS)), gains=(4.0, 4.0, 4.0, 4.0))
TURNING = replace(SkyScene.pointing(84.0, -1.0), rate_deg_s=(0.0, 5.0, 0.0), mag_limit=5.0)
QUIET = replace(CONDITION, noise=False)


def picture(readout_ps: int, settings: SensorSettings) -> np.ndarray:
    shutter = RollingShutter(readout_ps, LINE_PS, 1000, 1000)
    return Mt9m001Imager().picture(TURNING, QUIET, shutter, settings)


def test_a_window_s_rows_have_their_own_times() -> None:
    first_ps = 2 * 10**11
    part = picture(first_ps, WHOLE)[600:900]
    window = replace(WHOLE, row=600, rows=300)
    np.testing.assert_array_equal(picture(first_ps + int(600 * LINE_PS), window), part)
    assert (picture(first_ps, window) != part).any()
