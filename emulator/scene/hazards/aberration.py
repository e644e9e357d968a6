"""Aberration of light: stars appear displaced towards the observer's direction of motion.

Exact by special relativity (Explanatory Supplement to the Astronomical Almanac, section 7.2.3). The
Earth's motion around the Sun causes 20.5 arcsec of it, a satellite's motion around the Earth 5.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards import ephemeris
from cubestack.emulator.scene.hazards.contract import CameraState, SkyHazard, Vectors, direction
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.firmware_model.values import number, vector

LIGHT_KM_S = 299_792.458
FASTEST_KM_S = 3000.0


@dataclass(frozen=True, kw_only=True)
class Aberration(SkyHazard):
    """Aberration by the observer's velocity."""

    velocity_km_s: tuple[float, float, float] | None = vector(
        3, None, "of the observer; otherwise the sum of the Earth's at the date and of the orbit's"
    )
    julian_date: float = number(
        ephemeris.NEW_YEAR_2026, "Julian date at time 0", ephemeris.FIRST_DATE, ephemeris.LAST_DATE
    )
    orbit_km_s: float = number(7.6, "speed around the Earth", 0, 12)
    orbit_towards: tuple[float, ...] = heading(
        (0.0, 0.0, 1.0),
        "direction of that: three numbers, or right ascension and declination in deg",
    )

    meaning = "stars shifted by the observer's speed"
    strength = Strength("speed", "km/s", (0.0, 7.6, 15.0, 22.0, 30.0, 38.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        speed = float(np.linalg.norm(self.velocity_km_s or 0.0))
        if not speed <= FASTEST_KM_S:
            raise SceneError(
                f"velocity_km_s of the hazard {self.name} must be at most {FASTEST_KM_S:g}, "
                f"not {speed:g}"
            )

    @classmethod
    def sample(cls, strength: float, state: CameraState, generator: np.random.Generator) -> Self:
        del state
        towards = generator.standard_normal(3)
        x, y, z = (strength * towards / np.linalg.norm(towards)).tolist()
        return cls(velocity_km_s=(x, y, z))

    def velocity(self, time_s: float) -> Vectors:
        """Velocity (3,) of the observer in km/s."""
        if self.velocity_km_s is not None:
            return np.array(self.velocity_km_s)
        orbit = self.orbit_km_s * direction("orbit_towards", self.orbit_towards)
        return ephemeris.earth_velocity_km_s(self.julian_date + time_s / ephemeris.DAY_S) + orbit

    def apparent(self, state: CameraState, vectors: Vectors) -> Vectors:
        beta = self.velocity(state.time_s) / LIGHT_KM_S
        root = np.sqrt(1 - beta @ beta)
        along = vectors @ beta
        moved = root * vectors + (1 + along / (1 + root))[:, None] * beta
        return np.asarray(moved / (1 + along)[:, None])
