"""The Earth as seen from a satellite: size, day and night, uneven surface, glow at the limb.

CubeSense thesis, section 5.5: the angular radius, equation 5.5.1, and the Earth's radius. The rest
is assumed: a sphere that scatters sunlight equally in all directions (Lambert), a twilight, clouds
and land as a seeded sum of waves on the surface, and above the limb an atmosphere whose light
decreases exponentially with the height of the line of sight.

All vectors (to the Earth's centre, to the Sun, lines of sight) are in the same axes. Radiance 1 is
that of the mean surface with the Sun in its zenith.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

EARTH_RADIUS_KM = 6378.136

TWILIGHT = 0.05
"""Sine of the Sun's height in which day changes to night (assumed: 3 deg)."""

WAVES = 16
LONGEST_KM, SHORTEST_KM = 6000.0, 500.0  # assumed: continents, weather systems
GLOW_HEIGHTS = 8.0  # scale heights above which the glow is below a thousandth

Values = NDArray[np.float32]


def angular_radius_deg(altitude_km: float) -> float:
    """Angle between the Earth's centre and its limb, equation 5.5.1."""
    return float(np.degrees(np.arcsin(EARTH_RADIUS_KM / (EARTH_RADIUS_KM + altitude_km))))


@dataclass(frozen=True)
class Earth:
    """The Earth below a satellite."""

    altitude_km: float  # altitude of the satellite, above 0
    unevenness: float  # standard deviation of the surface's brightness, relative to its mean
    glow_km: float  # scale height of the limb's glow; 0 for none
    seed: int  # seed of the surface
    # relative brightness (n,) of the surface at unit vectors (n, 3) in its axes; None: even
    shine: Callable[[Values], Values] | None = None
    glow_heights: float = GLOW_HEIGHTS  # scale heights above which the glow is neglected

    @property
    def distance(self) -> float:
        """Distance from the Earth's centre in Earth radii."""
        return 1 + self.altitude_km / EARTH_RADIUS_KM

    def radiance(
        self,
        vectors: Values,
        pixel_rad: Values,
        nadir: NDArray[np.float64],
        sun: NDArray[np.float64],
        axes: NDArray[np.float64],
    ) -> tuple[NDArray[np.int64], Values]:
        """Mean radiance over small round pixels.

        Args:
            vectors: lines of sight (n, 3), unit vectors.
            pixel_rad: angle (n,) that each pixel spans.
            nadir: unit vector (3,) to the Earth's centre.
            sun: unit vector (3,) to the Sun.
            axes: rotation (3, 3) from the axes in which the surface is fixed.

        Returns:
            Indices (m,) of the lines of sight that meet the Earth or its glow, ascending, and
            radiance (m,).
        """
        radius = np.radians(angular_radius_deg(self.altitude_km))
        towards_earth = vectors @ nadir.astype(np.float32)
        reach = float(pixel_rad.max()) + self.glow_heights * self._glow / self._rise(radius)
        hit = np.flatnonzero(towards_earth > np.cos(radius + reach))
        cosine, sight = towards_earth[hit], vectors[hit]
        normal = self._normal(sight, cosine, nadir)
        light = _daylight(normal @ sun.astype(np.float32))
        light *= self._share(cosine, pixel_rad[hit], radius)
        if self.unevenness:
            light *= np.maximum(1 + self._pattern(normal, axes), 0)
        if self.shine is not None:
            light *= self.shine(normal @ axes.astype(np.float32))
        return hit, light

    def _normal(self, sight: Values, cosine: Values, nadir: NDArray[np.float64]) -> Values:
        """First intersection (n, 3) of each line of sight with the sphere, or its closest point."""
        d = np.float32(self.distance)
        half_chord = np.sqrt(np.maximum(1 - d * d * (1 - cosine * cosine), 0))
        point = sight * (d * cosine - half_chord)[:, None]
        point -= (self.distance * nadir).astype(np.float32)
        return np.asarray(point, np.float32)

    @property
    def _glow(self) -> float:
        return self.glow_km / EARTH_RADIUS_KM

    def _rise(self, radius: float) -> float:
        """Height of the line of sight above the limb per angle, in Earth radii per radian."""
        return self.distance * float(np.cos(radius))

    def _share(self, cosine: Values, pixel_rad: Values, radius: float) -> Values:
        """Share of each pixel that the surface fills, plus the glow's light in the rest."""
        # Angle above the limb in pixels, linear in the cosine, which is accurate near the limb.
        above = (np.float32(np.cos(radius)) - cosine) / (np.float32(np.sin(radius)) * pixel_rad)
        share = np.clip(np.float32(0.5) - above, 0, 1)
        if self._glow:
            limb = np.flatnonzero(above > -0.5)
            pixel = pixel_rad[limb] * np.float32(self._rise(radius) / self._glow)
            low, high = (np.maximum(above[limb] + half, 0) * pixel for half in (-0.5, 0.5))
            share[limb] += (np.exp(-low) - np.exp(-high)) / pixel
        return np.asarray(share, np.float32)

    @cached_property
    def _waves(self) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Wave vectors (WAVES, 3) in 1 / Earth radius and phases (WAVES,)."""
        generator = np.random.default_rng([self.seed, 0xEA127])
        direction = generator.standard_normal((WAVES, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        length_km = np.geomspace(LONGEST_KM, SHORTEST_KM, WAVES)
        phase = generator.uniform(0, 2 * np.pi, WAVES).astype(np.float32)
        return direction * (2 * np.pi * EARTH_RADIUS_KM / length_km)[:, None], phase

    def _pattern(self, normal: Values, axes: NDArray[np.float64]) -> Values:
        """Relative deviation (n,) of the surface's brightness from its mean."""
        vectors, phases = self._waves
        total = np.zeros(len(normal), np.float32)
        for vector, phase in zip((vectors @ axes.T).astype(np.float32), phases, strict=True):
            total += np.cos(normal @ vector + phase)
        # Each cosine has the variance 1/2.
        total *= np.float32(self.unevenness * np.sqrt(2 / WAVES))
        return total


def _daylight(sine: Values) -> Values:
    """Light on the ground from the sine of the Sun's height: the sine by day, 0 at night."""
    return np.asarray((sine + np.sqrt(sine * sine + np.float32(TWILIGHT**2))) / 2, np.float32)
