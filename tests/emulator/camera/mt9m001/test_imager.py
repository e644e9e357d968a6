"""Windows of a turning sky are exposed at their own rows' times."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import SensorSettings
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene

LINE_PS = Fraction(31_750_000)
WHOLE = SensorSettings(
    enabled=True,
    row=0,
    column=0,
    rows=1024,
    columns=1280,
    row_clocks=1524,
    blank_rows=26,
    exposure_rows=1000,
    gains=(4.0, 4.0, 4.0, 4.0),
)


def shutter(readout_ps: int) -> RollingShutter:
    return RollingShutter(readout_ps, LINE_PS, 1000, 1000)


def test_a_window_s_rows_have_their_own_times() -> None:
    scene = SkyScene(
        quaternion_from_pointing(84.0, -1.0, 0.0), rate_deg_s=(0.0, 5.0, 0.0), mag_limit=5.0
    )
    quiet = replace(CONDITION, noise=False)
    imager = Mt9m001Imager()
    first_ps = 2 * 10**11
    whole = imager.picture(scene, quiet, shutter(first_ps), WHOLE)
    window = replace(WHOLE, row=600, rows=300)
    later = shutter(first_ps + int(600 * LINE_PS))
    np.testing.assert_array_equal(imager.picture(scene, quiet, later, window), whole[600:900])
    earlier = imager.picture(scene, quiet, shutter(first_ps), window)
    assert (earlier != whole[600:900]).any()
