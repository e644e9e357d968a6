"""The lit ball in a dark box that stands for the Earth on the nadir sensor's bench.

CubeSense thesis, sections 5.4.1 (a clear ball, lit from behind; the sensor on a rotary stage), 5.5
(30 cm in radius, 3.52 cm away: as large as the Earth from 750 km) and 5.6 (an optic point that is
not in the stage's axis). The camera that turns sees what it would if the ball's centre went round
it, so a ball is an Earth without glow, whose altitude is in proportion.

The light is assumed to be even, as from a Sun behind the camera: a ninth less at the limb.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cubestack.emulator.scene.angles import vector_from_angles
from cubestack.emulator.scene.earth import EARTH_RADIUS_KM
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import SceneError

RADIUS_MM = 300.0
DISTANCE_MM = 35.2
"""Of the camera from the ball's surface."""


def ball_scene(
    angle_deg: Sequence[float] = (0.0, 0.0),
    radius_mm: float = RADIUS_MM,
    distance_mm: float = DISTANCE_MM,
    offset_mm: Sequence[float] = (0.0, 0.0, 0.0),
    **others: Any,
) -> EarthSunScene:
    """What the nadir camera sees with the stage turned to ``angle_deg``, (alpha, beta).

    Args:
        angle_deg: where the ball's centre would be with the optic point in the stage's axis.
        radius_mm: of the ball.
        distance_mm: of its surface from the stage's axis, along the way to its centre.
        offset_mm: of the optic point from the stage's axis, (3,) in camera axes.
        others: attributes of ``EarthSunScene``, such as ``unevenness`` (here 0 by default).

    Raises:
        SceneError: for a size that is not above 0, or an optic point in the ball.
    """
    if not (0 < radius_mm < np.inf and 0 < distance_mm < np.inf):
        raise SceneError(
            f"radius_mm and distance_mm must be above 0, not {radius_mm} and {distance_mm}"
        )
    centre = (radius_mm + distance_mm) * vector_from_angles(*angle_deg) - np.asarray(offset_mm)
    away = float(np.linalg.norm(centre))
    if not radius_mm < away:
        raise SceneError(f"offset_mm must leave the camera outside of the ball, not {offset_mm}")
    altitude_km = (away / radius_mm - 1) * EARTH_RADIUS_KM
    settings = {"unevenness": 0.0, "glow_km": 0.0, "altitude_km": altitude_km} | others
    direction = EarthSunScene().nadir_camera.matrix.T @ centre
    return EarthSunScene(nadir=direction, sun=-direction, **settings)
