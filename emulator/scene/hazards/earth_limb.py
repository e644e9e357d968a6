"""The Earth in front of the stars: its lit or dark disc, the air along the limb, the airglow above.

Disc and scattered light are those of ``emulator.scene.earth``. Airglow is a layer 95 km up, the
height of the green line of oxygen, with a Gaussian profile of 4 km (half-width 10 km) that gives
145 S10 to an observer on the ground, straight up (Benn and Ellison 1998, New Astronomy Reviews 42,
503: Sun's minimum). Along the limb the line of sight is in it for some 500 km, and in front of the
night side it is seen as well. Left out: city lights, lightning, moonlit ground, aurora, the bending
and reddening of starlight in the air; and light that the lens scatters, unless ``scatter`` says so:
without a baffle a hundredth of the lit Earth's light drowns all stars of the picture.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.earth import EARTH_RADIUS_KM, Earth, angular_radius_deg
from cubestack.emulator.scene.hazards.contract import (
    EARTH_RADIANCE,
    Brightness,
    Depth,
    Looking,
    Ring,
    SkyHazard,
    Vectors,
    angles_rad,
    aside,
    direction,
)
from cubestack.emulator.scene.hazards.glare import OUTER_RAD, aureole
from cubestack.emulator.scene.hazards.hazard import Strength, key
from cubestack.emulator.scene.hazards.sky_glow import S10

AIRGLOW_KM, AIRGLOW_SIGMA_KM, AIRGLOW_S10 = 95.0, 4.0, 145.0
TOP_KM = AIRGLOW_KM + 5 * AIRGLOW_SIGMA_KM
DUSK = 0.02
"""Sine of the Sun's depth below the horizon in which the ground's light falls to 1/e.

With the Earth's own twilight it is a 25 000th of the day's where the Sun is 6 deg down: 3.4 lux
(Seidelmann, Explanatory Supplement to the Astronomical Almanac, section 9.33).
"""

SUN_AWAY_DEG = 60.0
"""A random Sun is at least so far from the boresight (assumed): pointing is planned so."""


@dataclass(frozen=True, kw_only=True)
class EarthLimb(SkyHazard):
    """The Earth below a satellite, in some direction."""

    nadir: tuple[float, ...] = key(
        (0.0, 0.0, -1.0), "of its centre: three numbers, or right ascension and declination in deg"
    )
    sun: tuple[float, ...] | None = key(
        None, "direction of the Sun, likewise; without it, in the satellite's zenith"
    )
    altitude_km: float = key(600.0, "of the satellite", 150, 40_000)
    unevenness: float = key(0.1, "standard deviation of the surface's brightness, relative", 0, 1)
    glow_km: float = key(10.0, "height in which the lit air's glow falls to 1/e; 0 for none", 0, 50)
    airglow: float = key(1.0, "airglow by what is published", 0, 100)
    scatter: float = key(0.0, "share of its light that the lens scatters", 0, 0.2)

    name: ClassVar[str] = "earth-limb"
    meaning: ClassVar[str] = "the Earth's limb near the boresight or across the picture"
    strength: ClassVar[Strength] = Strength(
        "boresight to limb", "deg", (45.0, 30.0, 20.0, 15.0, 10.0, 5.0, 0.0), 5.0
    )
    depth: ClassVar[Depth] = Depth.EARTH

    def __post_init__(self) -> None:
        """Refuse what can not be: SceneError."""
        super().__post_init__()
        self._nadir, self._sun  # noqa: B018

    @classmethod
    def placed(cls, strength: float, looking: Looking, generator: np.random.Generator) -> Self:
        """The limb at this angle from the boresight, to any side; any Sun that is not in view."""
        radius = angular_radius_deg(600.0)
        nadir = looking.beside(min(radius + strength, 180), generator)
        lowest = math.cos(math.radians(SUN_AWAY_DEG))
        sun_deg = math.degrees(math.acos(generator.uniform(-1, lowest)))
        sun = aside(looking.boresight, sun_deg, generator)
        seed = int(generator.integers(2**31))
        return cls(nadir=tuple(nadir.tolist()), sun=tuple(sun.tolist()), seed=seed)

    @property
    def _nadir(self) -> Vectors:
        return direction("nadir", self.nadir)

    @property
    def _sun(self) -> Vectors:
        return -self._nadir if self.sun is None else direction("sun", self.sun)

    @property
    def _radius_rad(self) -> float:
        return math.radians(angular_radius_deg(self.altitude_km))

    @property
    def _distance_km(self) -> float:
        return EARTH_RADIUS_KM + self.altitude_km

    def glow(self, looking: Looking, vectors: Vectors) -> Brightness:
        """Surface, lit air, airglow and what the lens scatters of the surface."""
        total = np.zeros(len(vectors), np.float32)
        earth = Earth(self.altitude_km, self.unevenness, self.glow_km, self.seed)
        pixels = np.full(len(vectors), looking.pixel_rad, np.float32)
        sight = vectors.astype(np.float32)
        met, light = earth.radiance(sight, pixels, self._nadir, self._sun, np.eye(3))
        light *= self._night(vectors[met])
        total[met] = light * np.float32(EARTH_RADIANCE)
        angles = angles_rad(vectors, self._nadir)
        if self.airglow:
            nearest_km = self._distance_km * np.sin(angles) - EARTH_RADIUS_KM
            nearest_km[angles > math.pi / 2] = np.inf
            surface = angles < self._radius_rad
            total += np.float32(self.airglow * S10) * airglow_s10(nearest_km, surface)
        if self.scatter:
            total += self._scattered(vectors, angles)
        return total

    def _night(self, vectors: Vectors) -> Brightness:
        """What dusk leaves (n,) of the ground's light where lines of sight meet it: 1 by day."""
        far = self._distance_km / EARTH_RADIUS_KM
        ahead = far * (vectors @ self._nadir)
        to_ground = ahead - np.sqrt(np.maximum(ahead**2 + 1 - far**2, 0))
        normals = vectors * to_ground[:, None] - far * self._nadir
        sine = (normals @ self._sun) / np.linalg.norm(normals, axis=1)
        return np.exp(np.minimum(sine, 0) / DUSK).astype(np.float32)

    def _scattered(self, vectors: Vectors, angles: NDArray[np.float64]) -> Brightness:
        """What the lens scatters (n,) of the lit disc: a sum over parts of it."""
        places, area = _parts(self._radius_rad)
        across = np.cross(self._nadir, np.eye(3)[np.argmin(np.abs(self._nadir))])
        across /= np.linalg.norm(across)
        parts = places @ np.stack([across, np.cross(self._nadir, across), self._nadir])
        even = Earth(self.altitude_km, 0.0, 0.0, 0)
        small = np.full(len(parts), 1e-6, np.float32)
        met, light = even.radiance(
            parts.astype(np.float32), small, self._nadir, self._sun, np.eye(3)
        )
        light *= self._night(parts[met])
        total = np.zeros(len(vectors))
        reached = np.flatnonzero(angles < self._radius_rad + OUTER_RAD)
        for part, radiance in zip(parts[met], light, strict=True):
            share = aureole(angles_rad(vectors[reached], part), self.scatter)
            # No closer than the part is wide, which stands for all directions in it.
            most = aureole(np.array([math.sqrt(area / math.pi)]), self.scatter)[0]
            total[reached] += np.minimum(share, most) * float(radiance) * area
        return np.asarray(EARTH_RADIANCE * total, np.float32)

    def rings(self, looking: Looking) -> tuple[Ring, ...]:
        """The limb up to the airglow's top."""
        top = math.asin(min((EARTH_RADIUS_KM + TOP_KM) / self._distance_km, 1))
        inner = self._radius_rad - 2 * looking.pixel_rad
        return (Ring(self._nadir, inner, max(top, self._radius_rad + 2 * looking.pixel_rad)),)

    def hidden(self, looking: Looking, vectors: Vectors) -> NDArray[np.bool_]:
        """What is behind the disc."""
        del looking
        return angles_rad(vectors, self._nadir) < self._radius_rad


def airglow_s10(nearest_km: NDArray[np.float64], surface: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Airglow (n,) along lines of sight from above the layer, S10.

    Args:
        nearest_km: their least height above the Earth, negative for those that would go through it.
        surface: which of them end there: they meet the layer once.
    """
    heights, light = _airglow_profile()
    through = np.interp(nearest_km, heights, light, right=0)
    return np.asarray(np.where(surface, through / 2, through), np.float32)


@lru_cache(maxsize=1)
def _airglow_profile() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least heights (n,), and the airglow of a whole line of sight there, S10."""
    deep = -np.geomspace(EARTH_RADIUS_KM, 1, 200)
    heights = np.concatenate([deep, np.arange(0, TOP_KM + 0.25, 0.25)])
    # Along a line that comes as near as r to the centre, the height h is sqrt((R + h)^2 - r^2) on.
    layer = np.arange(AIRGLOW_KM - 5 * AIRGLOW_SIGMA_KM, TOP_KM, 0.05)
    away = (layer - AIRGLOW_KM) / AIRGLOW_SIGMA_KM
    emission = np.exp(-0.5 * away**2) * AIRGLOW_S10 / (AIRGLOW_SIGMA_KM * math.sqrt(2 * math.pi))
    nearest, above = EARTH_RADIUS_KM + heights[:, None], EARTH_RADIUS_KM + layer
    way = np.sqrt(np.maximum(above**2 - nearest**2, 0))
    middle = (emission[1:] + emission[:-1]) / 2
    return heights, 2 * (np.diff(way, axis=1) @ middle)


@lru_cache(maxsize=4)
def _parts(radius_rad: float) -> tuple[NDArray[np.float64], float]:
    """Directions (n, 3) of equal parts of a disc around the third axis, and their solid angle."""
    count = 400
    cosine = 1 - (np.arange(count) + 0.5) / count * (1 - math.cos(radius_rad))
    around = np.arange(count) * math.pi * (3 - math.sqrt(5))  # the golden angle spreads them
    sine = np.sqrt(1 - cosine**2)
    places = np.stack([sine * np.cos(around), sine * np.sin(around), cosine], axis=1)
    return places, 2 * math.pi * (1 - math.cos(radius_rad)) / count
