"""Surroundings of sun and nadir cameras: the Earth below, the Sun, the Moon, and false lights.

CubeSense thesis, sections 5.1.3.2 and 5.5. Directions are unit vectors in *scene axes*. These are
the satellite's body axes at time 0, or the inertial axes once `pointed` is used. The mounting of a
camera gives the directions of its boresight and of its picture's right side in body axes. Alpha and
beta are as in ``emulator.scene.attitude``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.attitude import (
    angles_from_vector,
    matrix_from_quaternion,
    propagate,
    vector_from_angles,
)
from cubestack.emulator.scene.earth import EARTH_RADIUS_KM, Earth, angular_radius_deg
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.contract import SkyHazard, check_hazards
from cubestack.emulator.scene.hazards.earth_below import Clouds, EarthHazard
from cubestack.emulator.scene.pointing import HIGHEST_KM, Pointing, Poses, pose_at, turn
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.values import (
    REQUIRED,
    DeclaredValues,
    choice,
    number,
    positive,
    vector,
    whole,
)

FASTEST_DEG_S = 1000.0
"""Largest body rate about one axis (assumed)."""

_IDENTITY = (0.0, 0.0, 0.0, 1.0)


class CameraTarget(IntEnum):
    """What a camera is meant to see, which distinguishes a satellite's two cameras."""

    SUN = 0
    NADIR = 1


def _unit(name: str, vector: ArrayLike) -> NDArray[np.float64]:
    v = np.asarray(vector, np.float64)
    if v.shape != (3,) or not 0 < np.linalg.norm(v) < np.inf:
        raise SceneError(f"{name} must be 3 numbers, not all 0, not {vector!r}")
    return v / np.linalg.norm(v)


@dataclass(frozen=True, eq=False)
class Mounting(DeclaredValues):
    """A camera's axes on the satellite; only the part of ``right`` across the boresight counts."""

    error = SceneError

    boresight: ArrayLike = vector(3, REQUIRED, "direction, body axes")
    right: ArrayLike = vector(3, (1.0, 0.0, 0.0), "direction of the picture's rows, body axes")

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.linalg.norm(np.cross(_unit("boresight", self.boresight), self._right_axis)) < 1e-6:
            raise SceneError(f"right must not be along the boresight {self.boresight!r}")

    @property
    def _right_axis(self) -> NDArray[np.float64]:
        return _unit("right", self.right)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Rotation (3, 3) from body axes to camera axes."""
        z = _unit("boresight", self.boresight)
        x = _unit("right", self._right_axis - (self._right_axis @ z) * z)
        return np.array([x, np.cross(z, x), z])


@dataclass(frozen=True)
class Reflection(DeclaredValues):
    """A false light in one camera's picture: a uniform disc.

    ``level`` is at the exposure of the published levels.
    """

    error = SceneError

    camera: CameraTarget = choice(
        REQUIRED,
        "the camera that sees it",
        {camera.name.lower(): camera for camera in CameraTarget},
    )
    alpha_deg: float = number(REQUIRED, "of its centre")
    beta_deg: float = number(REQUIRED, "of its centre")
    radius_px: float = positive(REQUIRED, "its size")
    level: float = positive(REQUIRED, "grey values above black")


@dataclass(frozen=True, eq=False)
class SensorTruth:
    """What a sensor should measure. For comparisons with results; the firmware never gets it."""

    #: unit vector (3,) in camera axes, to the Sun or to the Earth's centre
    vector: NDArray[np.float64]
    #: alpha_deg, beta_deg: the same direction as the sensor's angles
    alpha_deg: float
    beta_deg: float
    visible: bool  #: whether the Sun, or any part of the Earth, is in the camera's field


@dataclass(frozen=True, eq=False)
class EarthSunScene(DeclaredValues):
    """Surroundings of a satellite with a sun and a nadir camera; directions are in scene axes."""

    error = SceneError

    nadir: ArrayLike = vector(
        3, (0.0, 0.0, 1.0), "direction of the Earth's centre", role="direction"
    )
    sun: ArrayLike = vector(3, (0.0, 0.0, -1.0), "direction of the Sun", role="direction")
    moon: ArrayLike | None = vector(
        3,
        None,
        "direction of the Moon, whose phase follows from the Sun; if omitted, none",
        role="direction",
    )
    altitude_km: float = positive(750.0, "of the satellite", high=HIGHEST_KM)
    rate_deg_s: ArrayLike = vector(
        3, (0.0, 0.0, 0.0), "body rate in body axes", -FASTEST_DEG_S, FASTEST_DEG_S
    )
    # their mountings
    nadir_camera: Mounting = field(default_factory=lambda: Mounting((0.0, 0.0, 1.0)))
    sun_camera: Mounting = field(default_factory=lambda: Mounting((0.0, 0.0, -1.0)))
    unevenness: float = number(
        0.1, "standard deviation of the Earth's brightness, relative (assumed)", 0, 10
    )
    glow_km: float = number(
        10.0, "scale height of the glow above the limb; 0 for none (assumed)", 0, 1000
    )
    poses: Poses = ()  # attitudes, scene axes to body axes, each valid from its time on
    reflections: tuple[Reflection, ...] = ()  # false lights
    hazards: tuple[SkyHazard, ...] = ()  # other sources of light; some also place Earth and Sun
    seed: int = whole(0, "of the Earth's surface", 0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("nadir", "sun", "moon"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _unit(name, getattr(self, name)))
        check_hazards(self.hazards)
        radius = np.radians(angular_radius_deg(self.altitude_km))
        for hazard in self.hazards:
            if isinstance(hazard, EarthHazard):
                places = hazard.place_bodies(
                    np.asarray(self.nadir), np.asarray(self.sun), float(radius)
                )
                for name, vector in zip(("nadir", "sun"), places, strict=True):
                    object.__setattr__(self, name, vector)

    @classmethod
    def facing(
        cls,
        sun_deg: tuple[float, float] | None = (0.0, 0.0),
        nadir_deg: tuple[float, float] | None = (0.0, 0.0),
        **others: Any,
    ) -> "EarthSunScene":
        """A scene whose sensors should measure these (alpha, beta) at time 0.

        ``others`` are attributes of the class; for ``sun`` or ``nadir``, pass None for its angles.
        """
        mounted = cls(**others)
        if sun_deg is not None:
            others["sun"] = mounted.sun_camera.matrix.T @ vector_from_angles(*sun_deg)
        if nadir_deg is not None:
            others["nadir"] = mounted.nadir_camera.matrix.T @ vector_from_angles(*nadir_deg)
        return cls(**others)

    @property
    def earth(self) -> Earth:
        clouds = [hazard.shine for hazard in self.hazards if isinstance(hazard, Clouds)]
        shine = clouds[-1] if clouds else None
        return Earth(self.altitude_km, self.unevenness, self.glow_km, self.seed, shine)

    def axes(self, camera: CameraTarget, time_ps: int) -> NDArray[np.float64]:
        """Rotation (3, 3) from scene axes to a camera's axes at a time."""
        mounting = self.sun_camera if camera == CameraTarget.SUN else self.nadir_camera
        return mounting.matrix @ self._body(time_ps)

    def _body(self, time_ps: int) -> NDArray[np.float64]:
        """Rotation (3, 3) from scene axes to body axes at a time."""
        time_s, pose = time_ps / PS_PER_S, pose_at(self.poses, time_ps)
        turned = propagate(_IDENTITY, self.rate_deg_s, time_s) if pose is None else pose.at(time_s)
        return matrix_from_quaternion(turned)

    @property
    def moves(self) -> bool:
        """Whether the cameras do not see the same at all times."""
        return bool(self.poses) or bool(np.any(np.asarray(self.rate_deg_s)))

    def pointed(self, pointing: Pointing, at_s: float) -> "EarthSunScene":
        """The same surroundings of a satellite that is pointed anew at ``at_s``.

        Scene axes become the inertial axes of ``pointing``; the directions that it does not give
        stay as they are.
        """
        bodies = {name: getattr(pointing, name) for name in ("nadir", "sun", "moon", "altitude_km")}
        given = {name: one for name, one in bodies.items() if one is not None}
        return replace(self, poses=turn(self.poses, pointing.pose(at_s)), **given)

    def in_body_axes(self) -> "EarthSunScene":
        """The surroundings from the latest pose on, without `poses`: as a scene file has them."""
        if not self.poses:
            return self
        latest = self.poses[-1]
        back = matrix_from_quaternion(latest.at(0.0))
        places = {name: getattr(self, name) for name in ("nadir", "sun", "moon")}
        turned = {name: back @ one for name, one in places.items() if one is not None}
        return replace(self, poses=(), rate_deg_s=latest.rate_deg_s, **turned)

    def in_camera_axes(
        self, direction: ArrayLike, camera: CameraTarget, time_ps: int
    ) -> NDArray[np.float64]:
        """``direction`` (3,) of scene axes in a camera's axes at a time."""
        return self.axes(camera, time_ps) @ np.asarray(direction, np.float64)

    def hidden(self, direction: ArrayLike) -> bool:
        """Whether the Earth is in front of what lies in ``direction`` (3,), scene axes."""
        cosine = float(np.dot(np.asarray(direction, np.float64), np.asarray(self.nadir)))
        return cosine > float(np.cos(np.radians(angular_radius_deg(self.altitude_km))))

    def truth(self, camera: CameraTarget, time_ps: int, field_deg: float = 180.0) -> SensorTruth:
        """What the sensor of ``camera`` should measure at a time.

        ``field_deg`` is the largest angle from the boresight that its lens images.
        """
        of_sun = camera == CameraTarget.SUN
        vector = self.in_camera_axes(self.sun if of_sun else self.nadir, camera, time_ps)
        alpha, beta = angles_from_vector(vector)
        reach = field_deg if of_sun else field_deg + angular_radius_deg(self.altitude_km)
        visible = bool(np.hypot(alpha, beta) <= reach) and not (of_sun and self.hidden(self.sun))
        return SensorTruth(vector, alpha, beta, visible)


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
    """The nadir sensor's test bench, its stage turned to ``angle_deg``, (alpha, beta).

    A lit ball in a dark box stands for the Earth. CubeSense thesis, sections 5.4.1 (a translucent
    ball, lit from behind; the sensor on a rotary stage), 5.5 (30 cm in radius, 3.52 cm away: as
    large as the Earth from 750 km) and 5.6 (an optic point off the stage's axis). The turning
    camera sees what it would if the ball's centre moved around it, so a ball is an Earth without
    glow, with an altitude in proportion. The light is assumed to be even, as from a Sun behind the
    camera, and a ninth less at the limb.

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
