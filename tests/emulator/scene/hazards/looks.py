"""Who looks, in the tests of hazards."""

from fractions import Fraction

from cubestack.emulator.camera.common.exposure import camera_state_for
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.sky import SkyScene

SHUTTER = RollingShutter(10**12, Fraction(132_200_000), 2917, 2917)
ORION = SkyScene.pointing(83.8, -1.0)
NOW = camera_state_for(ORION.quaternion, LENS)
