"""Planets: lights as bright as the brightest stars that are in no catalogue.

Positions: ``ephemeris``. Magnitudes: the Astronomical Almanac's since 1984 (Meeus, Astronomical
Algorithms, chapter 41), by distances and phase angle. For Saturn with its ring, the phase angle
replaces the difference of longitudes, which is nearly the same.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards import ephemeris
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.firmware_model.values import number

#: Magnitude at 1 au from Sun and Earth, and its polynomial in the phase angle (deg).
MAGNITUDES = {
    "mercury": (-0.42, 0.0380, -0.000273, 0.000002),
    "venus": (-4.40, 0.0009, 0.000239, -0.00000065),
    "mars": (-1.52, 0.016),
    "jupiter": (-9.40, 0.005),
    "saturn": (-8.88, 0.044),
    "uranus": (-7.19,),
    "neptune": (-6.87,),
}

SATURN_POLE = sky.direction("pole", (40.589, 83.537))
"""Unit vector along the ring's axis, from its right ascension and declination (IAU)."""


@dataclass(frozen=True, kw_only=True)
class Planets(sky.SkyHazard):
    """All planets at a date, or a single bright light."""

    julian_date: float = number(
        ephemeris.NEW_YEAR_2026, "Julian date at time 0", ephemeris.FIRST_DATE, ephemeris.LAST_DATE
    )
    direction: tuple[float, ...] | None = heading(
        None, "of one planet, instead of all at the date: three numbers, or ra and dec in deg"
    )
    v_mag: float = number(-2.5, "magnitude of that planet", -5.0, 10.0)

    meaning = "planets among the stars"
    strength = Strength("v_mag", "mag", (6.0, 4.0, 2.0, 0.0, -2.5, -4.5), -2.5)
    depth = sky.Depth.PLANETS

    @classmethod
    def sample(
        cls, strength: float, state: sky.CameraState, generator: np.random.Generator
    ) -> Self:
        """One planet of this magnitude anywhere in the picture."""
        return cls(direction=tuple(state.random_direction(generator).tolist()), v_mag=strength)

    @property
    def bodies(self) -> tuple[sky.Body, ...]:
        if self.direction is not None:
            return (sky.Body("planet", sky.direction("direction", self.direction)),)
        there = {one: ephemeris.geocentric(one, self.julian_date) for one in MAGNITUDES}
        return tuple(sky.Body(one.title(), at / np.linalg.norm(at)) for one, at in there.items())

    def lights(self, state: sky.CameraState) -> sky.Lights:
        if self.direction is not None:
            return sky.Lights(
                sky.direction("direction", self.direction)[None], np.array([self.v_mag])
            )
        date = self.julian_date + state.time_s / ephemeris.DAY_S
        there = np.array([ephemeris.geocentric(planet, date) for planet in MAGNITUDES])
        earth = ephemeris.heliocentric("earth", date)
        v_mag = [
            magnitude(planet, vector + earth, vector)
            for planet, vector in zip(MAGNITUDES, there, strict=True)
        ]
        return sky.Lights(there / np.linalg.norm(there, axis=1, keepdims=True), np.array(v_mag))


def magnitude(planet: str, from_sun: sky.Vectors, from_earth: sky.Vectors) -> float:
    """V magnitude of a planet at ``from_sun`` and ``from_earth`` (3,), au."""
    r, distance = float(np.linalg.norm(from_sun)), float(np.linalg.norm(from_earth))
    cosine = float(from_sun @ from_earth) / (r * distance)
    phase_deg = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    at_1_au, *terms = MAGNITUDES[planet]
    v_mag = at_1_au + 5 * np.log10(r * distance)
    v_mag += sum(term * phase_deg ** (i + 1) for i, term in enumerate(terms))
    if planet == "saturn":
        tilt = abs(float(from_earth @ SATURN_POLE)) / distance
        v_mag += 1.25 * tilt**2 - 2.60 * tilt
    return float(v_mag)
