"""An object in orbit that crosses the field during an exposure: its image is a streak.

It moves along a great circle at a constant rate and with constant brightness. Debris below 1000 km
passes at 0.1 to 2 deg/s and has V 0 to 6 (assumed; a passing satellite has V 4 to 6).
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.contract import (
    Body,
    CameraState,
    Depth,
    Lights,
    SkyHazard,
    direction,
    random_direction_at,
)
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.firmware_model.values import number

SLOWEST_DEG_S, FASTEST_DEG_S = 0.1, 2.0


@dataclass(frozen=True, kw_only=True)
class Debris(SkyHazard):
    """One object that moves against the stars."""

    direction: tuple[float, ...] = heading(
        (0.0, 0.0, 1.0), "its place at `at_s`: three numbers, or ra and dec in deg"
    )
    towards: tuple[float, ...] = heading(
        (1.0, 0.0, 0.0), "a later place on its path, less than half a turn ahead, likewise"
    )
    rate_deg_s: float = number(0.5, "angular rate", 0, 20)
    v_mag: float = number(2.0, "its magnitude", -10, 10)
    at_s: float = number(0.0, "time when it is at `direction`", -1e6, 1e6, formerly="time_s")

    meaning = "an object that crosses the field"
    strength = Strength("v_mag", "mag", (8.0, 6.0, 4.0, 2.0, 0.0, -2.0, -4.0), 0)
    depth = Depth.ORBIT

    def __post_init__(self) -> None:
        super().__post_init__()
        here, there = direction("direction", self.direction), direction("towards", self.towards)
        if np.linalg.norm(np.cross(here, there)) < 1e-9:
            raise SceneError(f"towards of the hazard {self.name} must not be along direction")

    @classmethod
    def sample(cls, strength: float, state: CameraState, generator: np.random.Generator) -> Self:
        """One of this magnitude, anywhere in the picture in the middle of the exposure."""
        here = state.random_direction(generator)
        rate = math.exp(generator.uniform(math.log(SLOWEST_DEG_S), math.log(FASTEST_DEG_S)))
        return cls(
            direction=tuple(here.tolist()),
            towards=tuple(random_direction_at(here, 90.0, generator).tolist()),
            rate_deg_s=rate,
            v_mag=strength,
            at_s=state.time_s,
        )

    @property
    def speed_deg_s(self) -> float:
        return self.rate_deg_s

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (Body("debris", direction("direction", self.direction)),)

    def lights(self, state: CameraState) -> Lights:
        here, there = direction("direction", self.direction), direction("towards", self.towards)
        ahead = there - (there @ here) * here
        ahead /= np.linalg.norm(ahead)
        angle = math.radians(self.rate_deg_s * (state.time_s - self.at_s))
        place = math.cos(angle) * here + math.sin(angle) * ahead
        return Lights(place[None], np.array([self.v_mag]))
