"""The lit ball in a dark box that stands for the Earth on the nadir sensor's test bench.

CubeSense thesis, sections 5.4.1 (a translucent ball, lit from behind; the sensor on a rotary
stage), 5.5 (30 cm in radius, 3.52 cm away: as large as the Earth from 750 km) and 5.6 (an optic
point off the stage's axis). The turning camera sees what it would if the ball's centre moved around
it, so a ball is an Earth without glow, with an altitude in proportion.

The light is assumed to be even, as from a Sun behind the camera, and a ninth less at the limb.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.earth import EARTH_RADIUS_KM
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.values import number, positive, vector, whole

RADIUS_MM = 300.0
DISTANCE_MM = 35.2
"""Distance of the camera from the ball's surface."""

BALL = {
    "angle_deg": vector(2, (0.0, 0.0), "alpha and beta of the stage"),
    "radius_mm": positive(RADIUS_MM, "of the ball", unit="mm"),
    "distance_mm": positive(DISTANCE_MM, "of the ball's surface from the stage's axis", unit="mm"),
    "offset_mm": vector(3, (0.0, 0.0, 0.0), "of the optic point from the stage's axis"),
    "unevenness": number(0.0, "of the ball's brightness, relative", 0, 10),
    "seed": whole(0, "of the ball's surface", 0),
}
"""Arguments of `ball_scene` in scene files."""


def ball_scene(
    angle_deg: Sequence[float] = (0.0, 0.0),
    radius_mm: float = RADIUS_MM,
    distance_mm: float = DISTANCE_MM,
    offset_mm: Sequence[float] = (0.0, 0.0, 0.0),
    **others: Any,
) -> EarthSunScene:
    """The nadir camera's surroundings with the stage turned to ``angle_deg``, (alpha, beta).

    The ball's centre appears at ``angle_deg`` if the optic point is in the stage's axis;
    ``distance_mm`` is along the line to that centre. ``others`` are attributes of
    ``EarthSunScene``.

    Raises:
        SceneError: a size that is not above 0, or an optic point inside the ball.
    """
    for name, size in (("radius_mm", radius_mm), ("distance_mm", distance_mm)):
        try:
            BALL[name].check(size)
        except ValueError as error:
            raise SceneError(f"{name} {error}") from None
    centre = (radius_mm + distance_mm) * vector_from_angles(*angle_deg) - np.asarray(offset_mm)
    away = float(np.linalg.norm(centre))
    if not radius_mm < away:
        raise SceneError(f"offset_mm must leave the camera outside the ball, not {offset_mm}")
    altitude_km = (away / radius_mm - 1) * EARTH_RADIUS_KM
    settings = {"unevenness": 0.0, "glow_km": 0.0, "altitude_km": altitude_km} | others
    direction = EarthSunScene().nadir_camera.matrix.T @ centre
    return EarthSunScene(nadir=direction, sun=-direction, **settings)
