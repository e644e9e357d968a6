"""Earth, Sun and Moon around a satellite, and how they disturb a camera that looks at the sky."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.hazards import SKY_HAZARDS
from cubestack.emulator.scene.hazards.contract import SkyHazard
from cubestack.emulator.scene.hazards.ephemeris import AU_KM

SUN_RADIUS_KM = 696_000.0

DISTURBING = {"earth-limb": 60.0, "moon": 60.0, "sun-glare": 100.0}
"""Hazards for star trackers, and the angle in deg beyond which they are neglected."""

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies:
    """Unit vectors (3,) from the satellite, inertial axes; None for a body that is not known."""

    nadir: Vector | None = None  # to the Earth's centre
    sun: Vector | None = None
    moon: Vector | None = None
    altitude_km: float = 600.0
    sun_km: float = AU_KM  # distance of the Sun

    @property
    def shadow(self) -> float:
        """Share of the Sun's disc that the Earth's disc hides, 0 to 1; 0 if one is not known."""
        if self.nadir is None or self.sun is None:
            return 0.0
        earth = np.radians(angular_radius_deg(self.altitude_km))
        sun = np.arcsin(SUN_RADIUS_KM / self.sun_km)
        apart = np.arccos(np.clip(self.sun @ self.nadir, -1, 1))
        return hidden_share(float(sun), float(earth), float(apart))

    def disturb(self, hazards: tuple[SkyHazard, ...], boresight: Vector) -> tuple[SkyHazard, ...]:
        """``hazards`` of a star tracker, those of the known bodies replaced."""
        known = {"earth-limb": self.nadir, "moon": self.moon, "sun-glare": self.sun}
        others = tuple(one for one in hazards if known.get(one.name) is None)
        return (*others, *self._nearby(boresight))

    def _nearby(self, boresight: Vector) -> tuple[SkyHazard, ...]:
        def near(name: str, direction: Vector | None, radius_deg: float = 0.0) -> bool:
            if direction is None:
                return False
            away_deg = float(np.degrees(np.arccos(np.clip(boresight @ direction, -1, 1))))
            return away_deg - radius_deg < DISTURBING[name]

        sun = _triple(self.sun)
        found: dict[str, dict[str, Any]] = {}
        if near("earth-limb", self.nadir, angular_radius_deg(self.altitude_km)):
            stands = {"nadir": _triple(self.nadir), "sun": sun}
            found["earth-limb"] = {**stands, "altitude_km": self.altitude_km}
        if near("moon", self.moon):
            found["moon"] = {"direction": _triple(self.moon), "sun": sun}
        if self.shadow < 1 and near("sun-glare", self.sun):
            found["sun-glare"] = {"direction": sun}
        return tuple(SKY_HAZARDS[name](**values) for name, values in found.items())


def _triple(vector: Vector | None) -> tuple[float, ...] | None:
    return None if vector is None else tuple(vector.tolist())


def hidden_share(radius: float, other: float, apart: float) -> float:
    """Share of a disc that another, not smaller one hides; all angles in the same unit."""
    if apart >= radius + other:
        return 0.0
    if apart <= other - radius:
        return 1.0
    first = (apart**2 + radius**2 - other**2) / (2 * apart)  # to the common chord
    second = apart - first
    area = radius**2 * np.arccos(np.clip(first / radius, -1, 1))
    area += other**2 * np.arccos(np.clip(second / other, -1, 1))
    area -= apart * np.sqrt(max(radius**2 - first**2, 0.0))
    return float(area / (np.pi * radius**2))
