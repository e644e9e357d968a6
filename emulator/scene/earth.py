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

from cubestack.emulator.light import globe as lit

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
        globe = self._globe(nadir, sun, axes)
        hit, light = lit.radiance(vectors, pixel_rad, globe)
        if self.shine is not None:
            light *= self.shine(lit.normals(vectors[hit], globe) @ axes.astype(np.float32))
        return hit, light

    def _globe(
        self, nadir: NDArray[np.float64], sun: NDArray[np.float64], axes: NDArray[np.float64]
    ) -> lit.Globe:
        vectors, phases = self._waves
        return lit.Globe(
            distance=self.distance,
            centre=nadir,
            sun=sun,
            twilight=TWILIGHT,
            glow=self.glow_km / EARTH_RADIUS_KM,
            glow_heights=self.glow_heights,
            waves=vectors @ axes.T,
            phases=phases,
            # Each cosine has the variance 1/2.
            unevenness=self.unevenness * np.sqrt(2 / WAVES),
        )

    @cached_property
    def _waves(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Wave vectors (WAVES, 3) in turns per Earth radius, and phases (WAVES,) in turns."""
        generator = np.random.default_rng([self.seed, 0xEA127])
        direction = generator.standard_normal((WAVES, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        length_km = np.geomspace(LONGEST_KM, SHORTEST_KM, WAVES)
        return direction * (EARTH_RADIUS_KM / length_km)[:, None], generator.uniform(0, 1, WAVES)
