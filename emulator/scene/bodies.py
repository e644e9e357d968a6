"""Earth, Sun and Moon around a satellite, and how they disturb a camera that looks at the sky."""

from dataclasses import dataclass, replace
from functools import cached_property
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
        """``hazards`` of a star tracker, those of the known bodies put in place.

        Other values of such a hazard stay, for instance the lens's ``scatter``. Without any, it is
        there while its body is near ``boresight``.
        """
        others, own = [], {}
        for one in hazards:
            if one.name in self._places:
                own[one.name] = one
            else:
                others.append(one)
        for name, values in self._places.items():
            usual = SKY_HAZARDS[name](**values)
            kept = replace(own[name], **values) if name in own else usual
            if kept != usual or self._near(name, boresight):
                others.append(kept)
        return tuple(others)

    @cached_property
    def _places(self) -> dict[str, dict[str, Any]]:
        """Where the hazard of each known body is."""
        sun = None if self.sun is None else tuple(self.sun.tolist())
        found: dict[str, dict[str, Any]] = {}
        if self.nadir is not None:
            stands = {"nadir": tuple(self.nadir.tolist()), "sun": sun}
            found["earth-limb"] = {**stands, "altitude_km": self.altitude_km}
        if self.moon is not None:
            found["moon"] = {"direction": tuple(self.moon.tolist()), "sun": sun}
        if sun is not None and self.shadow < 1:
            found["sun-glare"] = {"direction": sun}
        return found

    def _near(self, name: str, boresight: Vector) -> bool:
        direction = {"earth-limb": self.nadir, "moon": self.moon, "sun-glare": self.sun}[name]
        assert direction is not None
        away_deg = float(np.degrees(np.arccos(np.clip(boresight @ direction, -1, 1))))
        radius_deg = angular_radius_deg(self.altitude_km) if name == "earth-limb" else 0.0
        return away_deg - radius_deg < DISTURBING[name]


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
