"""Integrals of a hazard's glow over parts of the sky."""

import math
from fractions import Fraction

import numpy as np

from cubestack.emulator.camera.common.exposure import camera_state_for
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.hazards.contract import CameraState, SkyHazard
from cubestack.emulator.scene.sky import SkyScene


def whole_light(hazard: SkyHazard, now: CameraState, centre: np.ndarray, reach_rad: float) -> float:
    """Light within ``reach_rad`` of ``centre``, in stars of V = 0: a sum over small equal areas."""
    side = np.cross(centre, [0.3, -0.5, 0.81])
    side /= np.linalg.norm(side)
    rings, sectors = 300, 200
    share = (np.arange(rings) + 0.5) / rings
    cosine = 1 - share * (1 - math.cos(reach_rad))
    sine = np.sqrt(1 - cosine**2)
    around = 2 * math.pi * (np.arange(sectors) + 0.5) / sectors
    across = np.cos(around)[:, None] * side + np.sin(around)[:, None] * np.cross(centre, side)
    vectors = cosine[:, None, None] * centre + sine[:, None, None] * across
    glow = hazard.glow(now, vectors.reshape(-1, 3))
    area = 2 * math.pi * (1 - math.cos(reach_rad))
    return float(glow.mean(dtype=np.float64)) * area


SHUTTER = RollingShutter(10**12, Fraction(132_200_000), 2917, 2917)
ORION = SkyScene.pointing(83.8, -1.0)
NOW = camera_state_for(ORION.quaternion, LENS)
