"""The Moon: its lit disc, and the light that the lens scatters around it.

Allen's Astrophysical Quantities (4th edition, section 12.3): magnitude by phase angle, radius at
the mean distance. The law of Lommel and Seeliger spreads the light over the disc, which makes a
full Moon uniform, as it is; the total has the magnitude above. Not modelled: dark plains,
earthshine (ten thousand times fainter), parallax.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.emulator.scene.hazards.sun_glare import SHARE, aureole
from cubestack.firmware_model.values import number

RADIUS_RAD = math.radians(0.2591)
"""Angular radius of the disc at the mean distance."""

STEEP_RAD = math.radians(3.0)
"""Within this angle the scattered light is not linear over a few pixels."""

PARTS = 5  # of a pixel along each axis, for its mean
LEAST_LIT = 1e-9  # of the phase integral, which is 0 for a new Moon


@dataclass(frozen=True, kw_only=True)
class Moon(sky.SkyHazard):
    """The Moon at a fixed direction, its phase given by the Sun's."""

    direction: tuple[float, ...] = heading(
        (0.0, 0.0, 1.0), "of its centre: three numbers, or right ascension and declination in deg"
    )
    sun: tuple[float, ...] | None = heading(
        None, "direction of the Sun, likewise, which gives the phase; if omitted, full"
    )
    scatter: float = number(SHARE, "share of its light that the lens scatters", 0, 0.2)

    meaning = "the Moon in the field"
    strength = Strength("lit", "", (0.01, 0.05, 0.2, 0.5, 0.8, 1.0))
    depth = sky.Depth.MOON

    @classmethod
    def sample(
        cls, strength: float, state: sky.CameraState, generator: np.random.Generator
    ) -> Self:
        """Anywhere in the picture; ``strength`` is the share of its disc that is lit, 0 to 1."""
        centre = state.random_direction(generator)
        phase_deg = math.degrees(math.acos(min(max(2 * strength - 1, -1), 1)))
        sun = sky.random_direction_at(centre, 180 - phase_deg, generator)
        return cls(direction=tuple(centre.tolist()), sun=tuple(sun.tolist()))

    @property
    def _centre(self) -> sky.Vectors:
        return sky.direction("direction", self.direction)

    @property
    def _sun(self) -> sky.Vectors:
        return -self._centre if self.sun is None else sky.direction("sun", self.sun)

    @property
    def bodies(self) -> tuple[sky.Body, ...]:
        moon = sky.Body("Moon", self._centre, math.degrees(RADIUS_RAD))
        return (
            (moon,) if self.sun is None else (moon, sky.Body("Sun", self._sun, sky.SUN_RADIUS_DEG))
        )

    @property
    def phase_deg(self) -> float:
        """Angle at the Moon between Sun and observer; 0 when full."""
        return 180 - math.degrees(float(sky.angles_rad(self._sun[None], self._centre)[0]))

    @property
    def v_mag(self) -> float:
        """Magnitude of the whole Moon, -12.73 when full."""
        return -12.73 + 0.026 * self.phase_deg + 4e-9 * self.phase_deg**4

    def glow(self, state: sky.CameraState, vectors: sky.Vectors) -> sky.Brightness:
        angles = sky.angles_rad(vectors, self._centre)
        light = 10 ** (-0.4 * self.v_mag)
        glow = light * aureole(angles, self.scatter)
        on = np.flatnonzero(angles < RADIUS_RAD + state.pixel_rad)
        glow[on] += light * self._disc(vectors[on], state.pixel_rad)
        return glow.astype(np.float32)

    def _disc(self, vectors: sky.Vectors, pixel_rad: float) -> NDArray[np.float64]:
        """Brightness (n,) per steradian of a disc whose total light is 1; means over pixels."""
        half_phase = math.radians(self.phase_deg) / 2
        lit = 1.0
        if half_phase > 1e-6:
            # Phase integral of Lommel and Seeliger's law, 1 when full.
            cotangent = 1 / math.tan(half_phase / 2)
            lit -= math.sin(half_phase) * math.tan(half_phase) * math.log(cotangent)
        # Axes of the disc's plane; the third points at the observer.
        right = np.cross(self._centre, np.eye(3)[np.argmin(np.abs(self._centre))])
        right /= np.linalg.norm(right)
        down = np.cross(self._centre, right)
        sun = np.array([right @ self._sun, down @ self._sun, -self._centre @ self._sun])
        parts = (np.arange(PARTS) + 0.5) / PARTS - 0.5
        x = (vectors @ right)[:, None, None] + parts * pixel_rad
        y = (vectors @ down)[:, None, None] + parts[:, None] * pixel_rad
        x, y = x / RADIUS_RAD, y / RADIUS_RAD
        facing = np.sqrt(np.maximum(1 - x * x - y * y, 0))
        sunlit = np.maximum(x * sun[0] + y * sun[1] + facing * sun[2], 0)
        sunlit[facing == 0] = 0
        shine = 2 * sunlit / np.maximum(sunlit + facing, 1e-12)
        even = 1 / (math.pi * RADIUS_RAD**2 * max(lit, LEAST_LIT))
        return np.asarray(even * shine.mean(axis=(1, 2)))

    def rings(self, state: sky.CameraState) -> tuple[sky.Ring, ...]:
        del state
        return (sky.Ring(self._centre, 0.0, STEEP_RAD),)

    def hidden(self, state: sky.CameraState, vectors: sky.Vectors) -> NDArray[np.bool_]:
        """What is behind the disc, lit or dark."""
        del state
        return sky.angles_rad(vectors, self._centre) < RADIUS_RAD
