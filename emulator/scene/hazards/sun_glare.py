"""Stray light of a bright source: scattered by the lens in its field, or past its baffle.

A source in the field. Assumed: a hundredth of the light is scattered, like the veiling glare of
clean multi-element lenses (ISO 9358 measures 1 to 3 % for usual ones), and its surface brightness
decreases with the square of the angle, like the aureole of stars (King 1971, PASP 83, 199), from
the angle of the Moon's limb to 45 degrees.

A source outside the field. The point source transmittance of a baffle falls by decades with the
source's angle from the boresight: measured curves of star trackers are nearly straight on a
logarithmic scale up to the angle beyond which the source lights no surface that the lens sees. Here
it is the brightness per steradian of the sky relative to the source's light, which is 4 N^2 / pi
times the irradiance ratio behind a lens of the f-number N. Assumed: 1e-7 at 45 deg (an irradiance
ratio of 5e-8 at f/1.25, of a small baffle), a decade in 15 deg; across the picture the stray light
falls exponentially with the angle from the source, to 1/e in ``slope_deg``.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.firmware_model.values import number

SHARE = 0.01
INNER_RAD, OUTER_RAD = math.radians(0.26), math.radians(45.0)


def aureole(away_rad: NDArray[np.float64], share: float = SHARE) -> NDArray[np.float64]:
    """Scattered brightness (n,) per steradian at these angles (n,) from a source of brightness 1.

    ``share`` of its light is scattered. Within the inner angle the brightness is constant.
    """
    scale = share / (2 * math.pi * math.log(OUTER_RAD / INNER_RAD))
    falling = scale / np.maximum(away_rad, INNER_RAD) ** 2
    return np.asarray(np.where(away_rad < OUTER_RAD, falling, 0.0))


REFERENCE_DEG = 45.0
MOST = 1.0
"""Largest transmittance per steradian, also for a source within the field."""


@dataclass(frozen=True, kw_only=True)
class SunGlare(sky.SkyHazard):
    """A bright source beside the field."""

    direction: tuple[float, ...] = heading(
        (0.0, 0.0, 1.0), "of the source: three numbers, or right ascension and declination in deg"
    )
    v_mag: float = number(
        sky.SUN_V, "its magnitude: Sun -26.74, lit Earth about -25, full Moon -12.73", -30, 30
    )
    transmittance: float = number(
        1e-7, "brightness per steradian at 45 deg, relative to its light", 0, 1
    )
    decade_deg: float = number(15.0, "angle over which that falls to a tenth", 1, 180)
    slope_deg: float = number(30.0, "angle across the picture over which it falls to 1/e", 1, 1e6)

    meaning = "stray light of the Sun beside the field"
    strength = Strength("angle", "deg", (90.0, 70.0, 60.0, 50.0, 45.0, 40.0, 35.0), 45.0)
    depth = sky.Depth.LENS

    @classmethod
    def sample(
        cls, strength: float, state: sky.CameraState, generator: np.random.Generator
    ) -> Self:
        """The Sun at this angle from the boresight, to any side."""
        return cls(direction=tuple(state.random_direction_at(strength, generator).tolist()))

    @property
    def bodies(self) -> tuple[sky.Body, ...]:
        name = "Sun" if self.v_mag == sky.SUN_V else "stray light"
        return (sky.Body(name, sky.direction("direction", self.direction), sky.SUN_RADIUS_DEG),)

    def glow(self, state: sky.CameraState, vectors: sky.Vectors) -> sky.Brightness:
        source = sky.direction("direction", self.direction)
        aside_rad = float(sky.angles_rad(state.boresight[None], source)[0])
        decades = (math.degrees(aside_rad) - REFERENCE_DEG) / self.decade_deg
        level = min(self.transmittance * 10**-decades, MOST) * 10 ** (-0.4 * self.v_mag)
        nearer_deg = np.degrees(aside_rad - sky.angles_rad(vectors, source))
        return np.asarray(level * np.exp(nearer_deg / self.slope_deg), np.float32)
