"""Scenes of cameras that look at the sky: the night sky from a moving spacecraft, or a picture."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.contract import SkyHazard, check_hazards
from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH
from cubestack.emulator.scene.picture import PictureScene
from cubestack.emulator.scene.pointing import FASTEST_DEG_S, Pointing, Pose, Poses, pose_at, turn
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.values import DeclaredValues, flag, number, vector, whole

__all__ = ["FASTEST_DEG_S", "PictureScene", "Pose", "Scene", "SceneError", "SkyScene"]

EPOCHS = (1800.0, 2200.0)
"""Julian years within which proper motions are straight, as assumed."""

MAGNITUDES = (-30.0, 30.0)
"""From brighter than the Sun to fainter than any telescope can detect."""

MOST_FALSE_STARS = 10_000


@dataclass(frozen=True, eq=False)
class SkyScene(DeclaredValues):
    """The night sky."""

    error = SceneError

    # attitude (4,) at time 0, scalar last, inertial (ICRS at ``epoch``) to camera
    quaternion: ArrayLike
    rate_deg_s: ArrayLike = (0.0, 0.0, 0.0)  # body rate (3,) in camera axes
    poses: Poses = ()  # later poses, each valid from its time on; in order of time
    epoch: float = number(
        DEFAULT_EPOCH, "Julian year to which proper motion moves the stars", *EPOCHS
    )
    mag_limit: float | None = number(None, "only stars with a lower V are visible", *MAGNITUDES)
    false_stars: int = whole(
        0, "lights at random places that are in no catalogue", 0, MOST_FALSE_STARS
    )
    false_star_mag: tuple[float, float] = vector(
        2, (2.0, 3.8), "range of their V, brightest first", *MAGNITUDES
    )
    # between camera and stars, but no other lights; None in space
    atmosphere: Atmosphere | None = None
    hazards: tuple[SkyHazard, ...] = ()  # what else gives light, or covers stars
    still: bool = flag(
        False, "stars do not move during an exposure: each stays where it is in the middle of it"
    )
    seed: int = whole(0, "of false stars and atmosphere", 0)

    def __post_init__(self) -> None:
        super().__post_init__()
        starts = [pose.at_s for pose in self.all_poses]
        if sorted(starts) != starts:
            raise SceneError(f"poses must be in order of time from 0 s on, not at {starts}")
        check_hazards(self.hazards)
        brightest, faintest = self.false_star_mag
        if not brightest <= faintest:
            raise SceneError(
                f"false_star_mag must have the brightest first, not {brightest:g}, {faintest:g}"
            )

    @classmethod
    def pointing(cls, ra_deg: float, dec_deg: float, roll_deg: float = 0.0) -> "SkyScene":
        """The sky along a boresight; the picture's up is ``roll_deg`` east of north."""
        return cls(quaternion_from_pointing(ra_deg, dec_deg, roll_deg))

    @cached_property
    def all_poses(self) -> Poses:
        """The pose at time 0, followed by the later ones."""
        return (Pose(self.quaternion, self.rate_deg_s), *self.poses)

    @cached_property
    def speed_deg_s(self) -> float:
        """Largest body rate that smears stars during an exposure."""
        return (
            0.0
            if self.still
            else max(float(np.linalg.norm(np.asarray(p.rate_deg_s))) for p in self.all_poses)
        )

    def pose_at(self, time_ps: int) -> Pose:
        return pose_at(self.poses, time_ps) or self.all_poses[0]

    def truth(self, time_ps: int) -> NDArray[np.float64]:
        """The attitude (4,) at a time: scalar last, inertial to camera."""
        return self.pose_at(time_ps).at(time_ps / PS_PER_S)

    def pointed(self, pointing: Pointing, at_s: float) -> "SkyScene":
        """The same sky from a camera that is pointed anew at ``at_s``.

        Earth, Sun and Moon where they are given and near; other hazards stay.
        """
        pose = pointing.pose(at_s)
        boresight = matrix_from_quaternion(pose.quaternion)[2]
        hazards = pointing.bodies().disturb(self.hazards, boresight)
        return replace(self, poses=turn(self.poses, pose), hazards=hazards)

    def false_lights(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places (n, 2) of the lights that are in no catalogue, and their magnitudes (n,).

        A place is column and row, each relative: 0 for the first pixel, 1 for the last.
        """
        generator = np.random.default_rng([self.seed, 0xFA15E])
        places = generator.random((self.false_stars, 2))
        return places, generator.uniform(*self.false_star_mag, self.false_stars)

    def rotate(self, rotation_deg: ArrayLike) -> "SkyScene":
        """The same sky, all poses rotated by a rotation vector (3,), camera axes, degrees."""
        first, *later = (
            replace(pose, quaternion=propagate(pose.quaternion, rotation_deg, 1.0))
            for pose in self.all_poses
        )
        return replace(self, quaternion=first.quaternion, poses=tuple(later))


Scene = SkyScene | PictureScene
