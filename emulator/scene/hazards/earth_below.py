"""Hazards of an Earth that is part of the scene: clouds, night side, a place near the Sun.

They only matter to scenes with an Earth below the satellite. Albedos: thick clouds 0.6, the sea
under clear air 0.12, the whole Earth 0.3 (Allen's Astrophysical Quantities, 4th edition, section
11.5; that of the sea includes the air above it). The distribution of clouds is assumed: a seeded
sum of waves on the surface, with a threshold.
"""

from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.earth import EARTH_RADIUS_KM
from cubestack.emulator.scene.hazards.contract import CameraState, Depth, SkyHazard, Vectors
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number

CLOUD, CLEAR = 0.6 / 0.3, 0.12 / 0.3
"""Brightness relative to that of the mean Earth."""

WAVES, LONGEST_KM, SHORTEST_KM = 32, 4000.0, 80.0
EDGE = 0.15
"""Width of a cloud's edge, in standard deviations of the sum of waves."""


class EarthHazard(SkyHazard):
    """A hazard that places Earth and Sun; this base leaves them where they are."""

    cameras: ClassVar[tuple[str, ...]] = ("nadir",)  #: names of those that it makes it harder for

    def place_bodies(
        self, nadir: Vectors, sun: Vectors, radius_rad: float
    ) -> tuple[Vectors, Vectors]:
        """Directions (3,) of the Earth, whose angular radius is ``radius_rad``, and Sun."""
        del radius_rad
        return nadir, sun


@dataclass(frozen=True, kw_only=True)
class Clouds(EarthHazard):
    """Clouds over a sea."""

    contrast: float = number(1.0, "1: white clouds on a dark sea; 0: uniform", 0, 1)
    cover: float = number(0.5, "share of the surface under clouds", 0.01, 0.99)

    meaning = "clouds on the Earth below"
    strength = Strength("contrast", "", (0.0, 0.2, 0.4, 0.6, 0.8, 1.0))
    depth = Depth.EARTH

    def shine(self, places: NDArray[np.float32]) -> NDArray[np.float32]:
        """Brightness (n,) of the surface relative to its mean.

        ``places`` are unit vectors (n, 3) in the Earth's own axes.
        """
        vectors, phases = self._waves
        total = np.zeros(len(places), np.float32)
        for vector, phase in zip(vectors, phases, strict=True):
            total += np.cos(places @ vector + phase)
        total *= np.float32(np.sqrt(2 / WAVES))
        level = NormalDist().inv_cdf(1 - self.cover)
        share = np.clip((total - np.float32(level)) / np.float32(EDGE) + np.float32(0.5), 0, 1)
        relative = CLEAR + (CLOUD - CLEAR) * share
        return np.asarray(1 + self.contrast * (relative - 1), np.float32)

    @cached_property
    def _waves(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Wave vectors (WAVES, 3) in 1 / Earth radius and phases (WAVES,)."""
        generator = np.random.default_rng([self.seed, 0xC10D])
        towards = generator.standard_normal((WAVES, 3))
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        length_km = np.geomspace(LONGEST_KM, SHORTEST_KM, WAVES)
        vectors = towards * (2 * np.pi * EARTH_RADIUS_KM / length_km)[:, None]
        phases = generator.uniform(0, 2 * np.pi, WAVES)
        return vectors.astype(np.float32), phases.astype(np.float32)


@dataclass(frozen=True, kw_only=True)
class Terminator(EarthHazard):
    """The Sun's place, given by how much of the Earth below is lit."""

    phase_deg: float = number(
        90.0, "angle at the Earth between satellite and Sun; 0: fully lit", 0, 180
    )
    towards_deg: float = number(0.0, "direction of the Sun around the nadir", -360, 360)

    meaning = "night on a part of the Earth below"
    strength = Strength("phase_deg", "deg", (0.0, 30.0, 60.0, 90.0, 110.0, 130.0, 150.0), 90.0)
    depth = Depth.EARTH

    @classmethod
    def sample(cls, strength: float, state: CameraState, generator: np.random.Generator) -> Self:
        del state
        return cls(phase_deg=strength, towards_deg=float(generator.uniform(0, 360)))

    def place_bodies(
        self, nadir: Vectors, sun: Vectors, radius_rad: float
    ) -> tuple[Vectors, Vectors]:
        del sun, radius_rad
        return nadir, _direction_from(
            -nadir, np.radians(self.phase_deg), np.radians(self.towards_deg)
        )


@dataclass(frozen=True, kw_only=True)
class EarthInSunCamera(EarthHazard):
    """The Earth in the Sun camera's field: near the Sun or in front of it."""

    above_deg: float = number(5.0, "of the Sun above the limb; negative: it has set", -90, 120)
    towards_deg: float = number(0.0, "direction of the Earth around the Sun", -360, 360)

    cameras = ("sun",)
    meaning = "the Earth beside the Sun, or in front of it"
    strength = Strength("above_deg", "deg", (60.0, 20.0, 5.0, 1.0, 0.3, -1.0), 1.0)
    depth = Depth.EARTH

    @classmethod
    def sample(cls, strength: float, state: CameraState, generator: np.random.Generator) -> Self:
        del state
        return cls(above_deg=strength, towards_deg=float(generator.uniform(0, 360)))

    def place_bodies(
        self, nadir: Vectors, sun: Vectors, radius_rad: float
    ) -> tuple[Vectors, Vectors]:
        del nadir
        away = radius_rad + np.radians(self.above_deg)
        return _direction_from(sun, min(float(away), np.pi), np.radians(self.towards_deg)), sun


def _direction_from(centre: Vectors, away_rad: float, around_rad: float) -> Vectors:
    """The unit vector (3,) at ``away_rad`` from ``centre``, to the side ``around_rad``."""
    one = np.cross(centre, np.eye(3)[np.argmin(np.abs(centre))])
    one /= np.linalg.norm(one)
    side = np.cos(around_rad) * one + np.sin(around_rad) * np.cross(centre, one)
    return np.asarray(np.cos(away_rad) * centre + np.sin(away_rad) * side)
