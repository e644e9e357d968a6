"""The Earth in front of the stars: its lit or dark disc, the air along the limb, the airglow above.

Disc and scattered light are those of ``emulator.scene.earth``, with the scale height of the air
where it is thin enough to see through (7 km, US Standard Atmosphere, 30 to 80 km). Airglow is a
layer 95 km up, the height of the green line of oxygen, with a Gaussian profile of 4 km (half-width
10 km) that gives 145 S10 to an observer on the ground, straight up (Benn and Ellison 1998, New
Astronomy Reviews 42, 503: Sun's minimum). A line of sight along the limb passes through some 500 km
of it; it also shows in front of the night side. Not modelled: city lights, lightning, moonlit
ground, aurora, refraction and reddening of starlight in the air. Light that the lens scatters is
off unless ``scatter`` sets it: without a baffle, one hundredth of the lit Earth's light hides all
stars of the picture.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.earth import EARTH_RADIUS_KM, Earth, angular_radius_deg
from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.emulator.scene.hazards.sky_glow import S10
from cubestack.emulator.scene.hazards.sun_glare import OUTER_RAD, aureole
from cubestack.firmware_model.values import number

AIRGLOW_KM, AIRGLOW_SIGMA_KM, AIRGLOW_S10 = 95.0, 4.0, 145.0
TOP_KM = AIRGLOW_KM + 5 * AIRGLOW_SIGMA_KM
GLOW_HEIGHTS = 20.0
"""Scale heights above which the lit air is as dark as the sky: star trackers can detect a
millionth of the ground's brightness."""

DUSK = 0.02
"""Sine of the Sun's depth below the horizon at which the ground's light falls to 1/e.

Together with the twilight of ``emulator.scene.earth``, the ground has a 25 000th of its daylight
where the Sun is 6 deg below the horizon: 3.4 lux (Seidelmann, Explanatory Supplement to the
Astronomical Almanac, section 9.33).
"""

PARTS = 400  # of the disc, for the sum of its scattered light
SUN_AWAY_DEG = 60.0
"""Least angle of a random Sun from the boresight (assumed: pointing avoids the Sun)."""


@dataclass(frozen=True, kw_only=True)
class EarthLimb(sky.SkyHazard):
    """The Earth below a satellite, in some direction."""

    nadir: tuple[float, ...] = heading(
        (0.0, 0.0, -1.0), "of its centre: three numbers, or right ascension and declination in deg"
    )
    sun: tuple[float, ...] | None = heading(
        None, "direction of the Sun, likewise; if omitted, the satellite's zenith"
    )
    altitude_km: float = number(600.0, "of the satellite", 150, 40_000)
    unevenness: float = number(
        0.1, "standard deviation of the surface's brightness, relative", 0, 1
    )
    glow_km: float = number(
        7.0, "height over which the lit air's glow falls to 1/e; 0 for none", 0, 50
    )
    airglow: float = number(1.0, "airglow relative to the published one", 0, 100)
    scatter: float = number(0.0, "share of its light that the lens scatters", 0, 0.2)

    meaning = "the Earth's limb near the boresight or across the picture"
    strength = Strength("boresight to limb", "deg", (45.0, 30.0, 20.0, 15.0, 10.0, 5.0, 0.0), 5.0)
    depth = sky.Depth.EARTH

    @classmethod
    def sample(
        cls, strength: float, state: sky.CameraState, generator: np.random.Generator
    ) -> Self:
        """The limb at this angle from the boresight, to any side; a Sun that is not in view."""
        radius = angular_radius_deg(600.0)
        nadir = state.random_direction_at(min(radius + strength, 180), generator)
        lowest = math.cos(math.radians(SUN_AWAY_DEG))
        sun_deg = math.degrees(math.acos(generator.uniform(-1, lowest)))
        sun = sky.random_direction_at(state.boresight, sun_deg, generator)
        seed = int(generator.integers(2**31))
        return cls(nadir=tuple(nadir.tolist()), sun=tuple(sun.tolist()), seed=seed)

    @property
    def bodies(self) -> tuple[sky.Body, ...]:
        radius_deg = angular_radius_deg(self.altitude_km)
        return sky.Body("Earth", self._nadir, radius_deg), sky.Body(
            "Sun", self._sun, sky.SUN_RADIUS_DEG
        )

    @property
    def _nadir(self) -> sky.Vectors:
        return sky.direction("nadir", self.nadir)

    @property
    def _sun(self) -> sky.Vectors:
        return -self._nadir if self.sun is None else sky.direction("sun", self.sun)

    @property
    def _radius_rad(self) -> float:
        return math.radians(angular_radius_deg(self.altitude_km))

    @property
    def _distance_km(self) -> float:
        return EARTH_RADIUS_KM + self.altitude_km

    def glow(self, state: sky.CameraState, vectors: sky.Vectors) -> sky.Brightness:
        total = np.zeros(len(vectors), np.float32)
        earth = Earth(
            self.altitude_km, self.unevenness, self.glow_km, self.seed, glow_heights=GLOW_HEIGHTS
        )
        pixels = np.full(len(vectors), state.pixel_rad, np.float32)
        sight = vectors.astype(np.float32)
        met, light = earth.radiance(sight, pixels, self._nadir, self._sun, np.eye(3))
        light *= self._night(vectors[met])
        total[met] = light * np.float32(sky.EARTH_RADIANCE)
        angles = sky.angles_rad(vectors, self._nadir)
        if self.airglow:
            nearest_km = self._distance_km * np.sin(angles) - EARTH_RADIUS_KM
            nearest_km[angles > math.pi / 2] = np.inf
            surface = angles < self._radius_rad
            total += np.float32(self.airglow * S10) * airglow_s10(nearest_km, surface)
        if self.scatter:
            total += self._scattered(vectors, angles)
        return total

    def _night(self, vectors: sky.Vectors) -> sky.Brightness:
        """Factor (n,) of dusk on the ground's light along ``vectors``: 1 by day."""
        far = self._distance_km / EARTH_RADIUS_KM
        ahead = far * (vectors @ self._nadir)
        to_ground = ahead - np.sqrt(np.maximum(ahead**2 + 1 - far**2, 0))
        normals = vectors * to_ground[:, None] - far * self._nadir
        sine = (normals @ self._sun) / np.linalg.norm(normals, axis=1)
        return np.asarray(np.exp(np.minimum(sine, 0) / DUSK), np.float32)

    def _scattered(self, vectors: sky.Vectors, angles: NDArray[np.float64]) -> sky.Brightness:
        """Light of the lit disc that the lens scatters (n,), at ``angles`` from nadir."""
        heights, turns, light = _scattered_light(self)
        right, down, _ = self._axes
        turn = np.abs(np.arctan2(vectors @ down, vectors @ right))
        row = np.interp(angles, heights, np.arange(len(heights)))
        column = np.interp(turn, turns, np.arange(len(turns)))
        above = np.minimum(row.astype(np.int64), len(heights) - 2)
        left = np.minimum(column.astype(np.int64), len(turns) - 2)
        row, column = row - above, column - left
        upper = light[above, left] * (1 - column) + light[above, left + 1] * column
        lower = light[above + 1, left] * (1 - column) + light[above + 1, left + 1] * column
        return np.asarray(upper * (1 - row) + lower * row, np.float32)

    @property
    def _axes(self) -> sky.Vectors:
        """Axes (3, 3): the third is nadir, the Sun is on the side of the first."""
        across = self._sun - (self._sun @ self._nadir) * self._nadir
        if np.linalg.norm(across) < 1e-9:
            across = np.cross(self._nadir, np.eye(3)[np.argmin(np.abs(self._nadir))])
        across /= np.linalg.norm(across)
        return np.stack([across, np.cross(self._nadir, across), self._nadir])

    def ground(self, vectors: sky.Vectors) -> NDArray[np.float64]:
        """Mean surface brightness (n,) of the ground along ``vectors`` (n, 3) that meet it."""
        even = Earth(self.altitude_km, 0.0, 0.0, 0)
        small = np.full(len(vectors), 1e-6, np.float32)
        light = np.zeros(len(vectors))
        met, shares = even.radiance(
            vectors.astype(np.float32), small, self._nadir, self._sun, np.eye(3)
        )
        light[met] = shares * self._night(vectors[met])
        return sky.EARTH_RADIANCE * light

    def rings(self, state: sky.CameraState) -> tuple[sky.Ring, ...]:
        top_km = EARTH_RADIUS_KM + max(TOP_KM, GLOW_HEIGHTS * self.glow_km)
        top = math.asin(min(top_km / self._distance_km, 1))
        inner = self._radius_rad - 2 * state.pixel_rad
        return (sky.Ring(self._nadir, inner, max(top, self._radius_rad + 2 * state.pixel_rad)),)

    def hidden(self, state: sky.CameraState, vectors: sky.Vectors) -> NDArray[np.bool_]:
        del state
        return sky.angles_rad(vectors, self._nadir) < self._radius_rad


def airglow_s10(nearest_km: NDArray[np.float64], surface: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Airglow (n,) along lines of sight from above the layer, S10.

    Args:
        nearest_km: their least height above the Earth, negative for those that would go through it.
        surface: which of them end at the ground: they pass the layer only once.
    """
    heights, light = _airglow_profile()
    through = np.interp(nearest_km, heights, light, right=0)
    return np.asarray(np.where(surface, through / 2, through), np.float32)


@lru_cache(maxsize=1)
def _airglow_profile() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least heights (n,) in km, and the airglow (n,) of a whole line of sight, S10."""
    deep = -np.geomspace(EARTH_RADIUS_KM, 1, 200)
    heights = np.concatenate([deep, np.arange(0, TOP_KM + 0.25, 0.25)])
    # A line of sight at least r from the centre has height h at sqrt((R + h)^2 - r^2) from there.
    layer = np.arange(AIRGLOW_KM - 5 * AIRGLOW_SIGMA_KM, TOP_KM, 0.05)
    away = (layer - AIRGLOW_KM) / AIRGLOW_SIGMA_KM
    emission = np.exp(-0.5 * away**2) * AIRGLOW_S10 / (AIRGLOW_SIGMA_KM * math.sqrt(2 * math.pi))
    nearest, above = EARTH_RADIUS_KM + heights[:, None], EARTH_RADIUS_KM + layer
    way = np.sqrt(np.maximum(above**2 - nearest**2, 0))
    middle = (emission[1:] + emission[:-1]) / 2
    return heights, 2 * (np.diff(way, axis=1) @ middle)


@lru_cache(maxsize=4)
def _scattered_light(
    limb: EarthLimb,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A map around nadir of the lit disc's light that a lens scatters.

    Returns:
        Angles (n,) from nadir, angles (m,) around it from the Sun's side, 0 to pi, and surface
        brightness (n, m): the sum over equal parts of the disc.
    """
    radius = math.radians(angular_radius_deg(limb.altitude_km))
    # Steps of the golden angle spread the parts evenly.
    cosine = 1 - (np.arange(PARTS) + 0.5) / PARTS * (1 - math.cos(radius))
    turned = np.arange(PARTS, dtype=np.float64) * (math.pi * (3 - math.sqrt(5)))
    parts = _directions(np.arccos(cosine), np.asarray(turned))
    area = 2 * math.pi * (1 - math.cos(radius)) / PARTS
    light = limb.ground(parts @ limb._axes) * area
    heights = np.linspace(0, min(radius + OUTER_RAD, math.pi), 120)
    turns = np.linspace(0, math.pi, 40)
    places = _directions(np.repeat(heights, len(turns)), np.tile(turns, len(heights)))
    apart = np.arccos(np.clip(places @ parts.T, -1, 1))
    # A part has an area: scattered light does not peak within its radius.
    scattered = aureole(np.maximum(apart, math.sqrt(area / math.pi)), limb.scatter) @ light
    return heights, turns, scattered.reshape(len(heights), len(turns))


def _directions(heights: NDArray[np.float64], turns: NDArray[np.float64]) -> sky.Vectors:
    """Unit vectors (n, 3) at angles ``heights`` (n,) from the third axis, ``turns`` around it."""
    sine = np.sin(heights)
    return np.stack([sine * np.cos(turns), sine * np.sin(turns), np.cos(heights)], axis=1)
