"""The motion of a camera or a satellite: attitudes that are valid from a time on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.attitude import propagate
from cubestack.emulator.scene.bodies import Bodies
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.picture import check_quaternion
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.values import REQUIRED, DeclaredValues, number, positive, vector

FASTEST_DEG_S = 100.0
"""Largest body rate about one axis (assumed): a star smears over the picture's whole height.

The time to render a frame grows with the rate, to ten seconds at this one.
"""

HIGHEST_KM = 1e6
"""Largest altitude (assumed): there the Earth is half a pixel wide."""

KEPT_S = 10.0
"""Earlier poses are kept for this time: longer than an exposure and the processing after it."""


@dataclass(frozen=True, eq=False)
class Pose(DeclaredValues):
    """An attitude and a constant body rate, valid from a time on.

    ``quaternion`` (4,), scalar last, inertial to camera, is the attitude at ``at_s``.
    """

    error = SceneError

    quaternion: ArrayLike
    rate_deg_s: ArrayLike = vector(
        3, (0.0, 0.0, 0.0), "body rate about the camera axes", -FASTEST_DEG_S, FASTEST_DEG_S
    )
    at_s: float = number(0.0, "virtual time from which the pose is valid", formerly="start_s")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_quaternion(self.quaternion)

    def at(self, time_s: float) -> NDArray[np.float64]:
        return propagate(self.quaternion, self.rate_deg_s, time_s - self.at_s)


Poses = tuple[Pose, ...]


def pose_at(poses: Poses, time_ps: int) -> Pose | None:
    """The latest of ``poses`` that has begun; None before the first."""
    begun = [pose for pose in poses if pose.at_s * PS_PER_S <= time_ps]
    return begun[-1] if begun else None


def turn(poses: Poses, pose: Pose) -> Poses:
    """``poses``, replaced by ``pose`` from its time on; those that no image needs are left out."""
    earlier = [one for one in poses if one.at_s < pose.at_s]
    old = [one for one in earlier if one.at_s < pose.at_s - KEPT_S]
    return (*old[-1:], *earlier[len(old) :], pose)


@dataclass(frozen=True, eq=False)
class Pointing(DeclaredValues):
    """A device's attitude and body rate, and the directions of the bodies around it.

    Directions are from the satellite. What is None stays as it is in the scene.
    The device's axes are the camera axes of a star tracker, and the body axes of a satellite with
    a sun and a nadir sensor.
    """

    error = SceneError

    quaternion: ArrayLike = vector(
        4, REQUIRED, "attitude, inertial axes to the device's, scalar last"
    )
    rate_deg_s: ArrayLike = vector(
        3, (0.0, 0.0, 0.0), "body rate in the device's axes", -FASTEST_DEG_S, FASTEST_DEG_S
    )
    nadir: ArrayLike | None = vector(3, None, "direction of the Earth's centre, inertial axes")
    sun: ArrayLike | None = vector(3, None, "direction of the Sun, inertial axes")
    moon: ArrayLike | None = vector(3, None, "direction of the Moon, inertial axes")
    altitude_km: float | None = positive(None, "of the satellite", high=HIGHEST_KM)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_quaternion(self.quaternion)
        for name in ("nadir", "sun", "moon"):
            self._unit(name)

    @classmethod
    def parse(cls, words: Sequence[str]) -> Self:
        """From ``NAME=VALUE`` words as `words` returns them; SceneError for a wrong one."""
        given = dict(word.partition("=")[::2] for word in words)
        declared = cls.declared()
        for name in given:
            if name not in declared:
                raise SceneError(f"point: no value {name!r}; known: {', '.join(declared)}")
        if "quaternion" not in given:
            raise SceneError("point needs quaternion=X,Y,Z,W")
        values = {}
        for name, text in given.items():
            try:
                values[name] = declared[name].parse(text)
            except ValueError as error:
                raise SceneError(f"point: {name} {error}") from None
        return cls(**values)

    def words(self) -> tuple[str, ...]:
        """As words of the shell's ``point``, exact to the last bit."""
        given = {name: getattr(self, name) for name in self.declared()}
        return tuple(
            f"{name}={','.join(repr(float(part)) for part in np.ravel(value))}"
            for name, value in given.items()
            if value is not None
        )

    def pose(self, at_s: float) -> Pose:
        return Pose(self.quaternion, self.rate_deg_s, at_s)

    def bodies(self) -> Bodies:
        """Those that are given."""
        known = {} if self.altitude_km is None else {"altitude_km": self.altitude_km}
        nadir, sun, moon = map(self._unit, ("nadir", "sun", "moon"))
        return Bodies(nadir=nadir, sun=sun, moon=moon, **known)

    def _unit(self, name: str) -> NDArray[np.float64] | None:
        given = getattr(self, name)
        if given is None:
            return None
        length = float(np.linalg.norm(given))
        if length == 0:
            raise SceneError(f"{name} must be 3 numbers, not all 0")
        return np.asarray(given, np.float64) / length
