"""Uniform or sloping light over the whole picture: stray light given in grey values.

These hazards add their declared grey values whatever the exposure and the gain.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np

from cubestack.emulator.camera.common.hazards.contract import Exposure, Field, SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number


@dataclass(frozen=True, kw_only=True)
class Gradient(SensorHazard):
    """A slope of light from one corner or edge to the opposite one."""

    meaning = "a slope of stray light across the picture"
    strength = Strength("counts", "counts", (0, 5, 10, 20, 40, 60), 60)

    counts: float = number(30.0, "grey values at its bright end; 0 at the other end", 0, 255)

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        del generator
        return _slope(self.seed, exposure.shape) * np.float32(
            self.counts * exposure.electrons_per_count
        )


@dataclass(frozen=True, kw_only=True)
class Background(SensorHazard):
    """A uniform level, with more noise than its own shot noise."""

    meaning = "a uniform level of stray light, and noise"
    strength = Strength("counts", "counts", (0, 5, 10, 20, 40, 80), 20)

    counts: float = number(20.0, "grey values added", 0, 255)
    sigma: float = number(4.0, "standard deviation of the additional noise, grey values", 0, 100)

    @classmethod
    def sample(cls, strength: float, state: Any, generator: np.random.Generator) -> Self:
        """With additional noise of a fifth of the level."""
        return replace(super().sample(strength, state, generator), sigma=strength / 5)

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        del generator
        level = np.float32(self.counts * exposure.electrons_per_count)
        return np.full(exposure.shape, level, np.float32)

    def noise(self, exposure: Exposure) -> float:
        """Standard deviation of the additional noise, electrons."""
        return self.sigma * exposure.electrons_per_count


@lru_cache(maxsize=4)
def _slope(seed: int, shape: tuple[int, int]) -> Field:
    """From 0 to 1 in the direction that ``seed`` gives."""
    angle = 2 * math.pi * np.random.default_rng([seed, 0x62AD]).random()
    y, x = np.ogrid[-1 : 1 : shape[0] * 1j, -1 : 1 : shape[1] * 1j]
    slope = math.cos(angle) * x + math.sin(angle) * y
    half = abs(math.cos(angle)) + abs(math.sin(angle))
    return np.asarray((slope / half + 1) / 2, np.float32)
