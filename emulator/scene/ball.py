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
from cubestack.firmware_model.values import named, number, positive, vector, whole

RADIUS_MM = 300.0
DISTANCE_MM = 35.2
"""Of the camera from the ball's surface."""

BALL = named(
    {
        "angle_deg": vector(2, (0.0, 0.0), "alpha and beta that the stage is turned to"),
        "radius_mm": positive(RADIUS_MM, "of the ball"),
        "distance_mm": positive(DISTANCE_MM, "of its surface from the axis"),
        "offset_mm": vector(3, (0.0, 0.0, 0.0), "of the optic point from the axis"),
        "unevenness": number(0.0, "of the ball's brightness, relative", 0, 10),
        "seed": whole(0, "of the ball's surface", 0),
    }
)
"""Arguments of `ball_scene` that scene files have."""


def ball_scene(
    angle_deg: Sequence[float] = (0.0, 0.0),
    radius_mm: float = RADIUS_MM,
    distance_mm: float = DISTANCE_MM,
    offset_mm: Sequence[float] = (0.0, 0.0, 0.0),
    **others: Any,
) -> EarthSunScene:
    """What the nadir camera sees with the stage turned to ``angle_deg``, (alpha, beta).

    The ball's centre would be at ``angle_deg`` with the optic point in the stage's axis, and
    ``distance_mm`` is along the way to that centre. ``others`` are attributes of ``EarthSunScene``.

    Raises:
        SceneError: for a size that is not above 0, or an optic point in the ball.
    """
    for name, size in (("radius_mm", radius_mm), ("distance_mm", distance_mm)):
        try:
            BALL[name].check(size)
        except ValueError as error:
            raise SceneError(f"{name} {error}") from None
    centre = (radius_mm + distance_mm) * vector_from_angles(*angle_deg) - np.asarray(offset_mm)
    away = float(np.linalg.norm(centre))
    if not radius_mm < away:
        raise SceneError(f"offset_mm must leave the camera outside of the ball, not {offset_mm}")
    altitude_km = (away / radius_mm - 1) * EARTH_RADIUS_KM
    settings = {"unevenness": 0.0, "glow_km": 0.0, "altitude_km": altitude_km} | others
    direction = EarthSunScene().nadir_camera.matrix.T @ centre
    return EarthSunScene(nadir=direction, sun=-direction, **settings)
