"""The base of all hazards of light: something in front of a camera that is in no star catalogue.

A hazard gives points of light, a glow, or both. It may also hide what is behind it, and shift the
apparent direction of starlight. It knows no sensor. Directions are unit vectors in the scene's
axes: ICRS for the night sky, the satellite's body axes at time 0 for Earth and Sun.

Brightness is in units of a star of V = 0: a light has 10^(-0.4 V) of it; a glow is in such stars
per steradian.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.hazard import Hazard

SUN_V = -26.74
"""Apparent magnitude of the Sun from the Earth (Allen's Astrophysical Quantities, section 14.2)."""

SUN_RADIUS_DEG = 0.2666
"""Angular radius of its disc at 1 au (likewise)."""

EARTH_RADIANCE = 0.3 / math.pi * 10 ** (-0.4 * SUN_V)
"""Radiance 1 of ``emulator.scene.earth``, in V = 0 stars per steradian; for an albedo of 0.3."""

Vectors = NDArray[np.float64]
Brightness = NDArray[np.float32]


class Depth(IntEnum):
    """Order of hazards along the line of sight, the farthest first."""

    SKY = 0
    PLANETS = 1
    MOON = 2
    EARTH = 3
    ORBIT = 4
    LENS = 5


@dataclass(frozen=True, eq=False)
class Lights:
    """Points of light: unit vectors (n, 3) to them, and their V magnitudes (n,)."""

    vectors: Vectors
    v_mag: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """Something in the sky, for a map: its name, unit vector (3,) to its centre, angular radius."""

    name: str
    direction: Vectors
    radius_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class Ring:
    """Region where a glow is not smooth: between two angles around a direction.

    ``centre`` is a unit vector (3,); the angles count from there.
    """

    centre: Vectors
    inner_rad: float
    outer_rad: float


@dataclass(frozen=True, eq=False)
class CameraState:
    """The camera at one instant of an exposure, as far as hazards need it."""

    axes: Vectors  #: (3, 3), the camera's x, y and boresight as rows, in the scene's axes
    #: width_deg, height_deg: of the picture, as angles from edge to edge through its centre
    width_deg: float
    height_deg: float
    half_field_deg: float  #: angle from the boresight beyond which no light reaches the picture
    pixel_rad: float  #: angle of a pixel on the boresight
    time_s: float = 0.0  #: virtual time of the instant
    exposure_s: float = 0.0  #: of each pixel

    @property
    def boresight(self) -> Vectors:
        return np.asarray(self.axes[2])

    def random_direction(self, generator: np.random.Generator) -> Vectors:
        """A random direction (3,) within the picture, uniform in its angles."""
        while True:
            across, down = generator.uniform(-0.5, 0.5, 2) * (self.width_deg, self.height_deg)
            if math.hypot(across, down) <= self.half_field_deg:
                return np.asarray(vector_from_angles(across, down) @ self.axes, np.float64)

    def random_direction_at(self, angle_deg: float, generator: np.random.Generator) -> Vectors:
        """A direction (3,) at ``angle_deg`` from the boresight, to a random side."""
        around = generator.uniform(0, 2 * math.pi)
        sides = angle_deg * np.cos(around), angle_deg * np.sin(around)
        return np.asarray(vector_from_angles(*sides) @ self.axes, np.float64)


@dataclass(frozen=True, kw_only=True)
class SkyHazard(Hazard):
    """Base of hazards of light; by itself it has no effect.

    It hides glow and lights of the hazards that are farther away by ``depth``.
    """

    depth: ClassVar[Depth] = Depth.SKY

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, declaration in self.declared().items():
            value = getattr(self, name)
            if declaration.role == "direction" and value is not None:
                direction(name, value)

    @property
    def speed_deg_s(self) -> float:
        """Angular rate of its lights against the stars."""
        return 0.0

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies whose place at time 0 it gives."""
        return ()

    def lights(self, state: CameraState) -> Lights | None:
        del state
        return None

    def glow(self, state: CameraState, vectors: Vectors) -> Brightness | None:
        """Its surface brightness (n,) along ``vectors`` (n, 3), V = 0 stars per steradian.

        Where it changes within a pixel: the mean over a round pixel of ``state.pixel_rad``.
        """
        del state, vectors
        return None

    def rings(self, state: CameraState) -> tuple[Ring, ...]:
        """Where its glow changes from pixel to pixel; elsewhere it is linear over 16 px."""
        del state
        return ()

    def hidden(self, state: CameraState, vectors: Vectors) -> NDArray[np.bool_] | None:
        """Which directions ``vectors`` (n, 3) it covers, (n,); None for none."""
        del state, vectors
        return None

    def apparent(self, state: CameraState, vectors: Vectors) -> Vectors:
        """Apparent directions (n, 3) of points at ``vectors`` (n, 3)."""
        del state
        return vectors


def direction(name: str, values: ArrayLike) -> Vectors:
    """Unit vector (3,) of three numbers, or of right ascension and declination in degrees.

    Raises:
        SceneError: ``values`` are neither; the text starts with ``name``.
    """
    v = np.asarray(values, np.float64)
    if v.shape == (2,) and np.all(np.isfinite(v)):
        if not (abs(v[0]) <= 360 and abs(v[1]) <= 90):
            raise SceneError(
                f"{name} must be a right ascension of -360 to 360 deg and a declination of -90 to "
                f"90, not {values!r}"
            )
        ra, dec = np.radians(v)
        v = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    if v.shape != (3,) or not 0 < np.linalg.norm(v) < np.inf:
        raise SceneError(
            f"{name} must be 3 numbers, not all 0, or right ascension and declination, not "
            f"{values!r}"
        )
    return v / np.linalg.norm(v)


def angles_rad(vectors: Vectors, centre: Vectors) -> NDArray[np.float64]:
    """Angles (n,) between unit vectors (n, 3) and one (3,), exact for small angles too."""
    chord = np.linalg.norm(vectors - centre, axis=-1)
    return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)))


def random_direction_at(
    centre: Vectors, angle_deg: float, generator: np.random.Generator
) -> Vectors:
    """A unit vector (3,) at ``angle_deg`` from ``centre``, to a random side."""
    side = np.cross(centre, generator.standard_normal(3))
    side /= np.linalg.norm(side)
    angle = math.radians(angle_deg)
    return np.asarray(math.cos(angle) * centre + math.sin(angle) * side)


def check_hazards(hazards: Sequence[object]) -> None:
    """Raise SceneError if one of ``hazards`` is not a hazard of light."""
    for hazard in hazards:
        if not isinstance(hazard, SkyHazard):
            raise SceneError(f"hazards must be hazards of light, not {hazard!r}")
