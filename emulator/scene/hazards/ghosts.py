"""Reflections of the Sun in a lens: faint images across the optical axis, and veiling glare.

Light reflected by two surfaces of a lens makes a ghost: an unfocused image on the line through the
optical axis and the Sun, mostly beyond the axis. A coated surface reflects 0.5 to 1 per cent
(Smith, Modern Optical Engineering, section 7.9), so a ghost has up to 1e-4 of the light. Places and
widths of ghosts are random (assumed). Only a Sun within the field makes them.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubestack.emulator.scene.attitude import angles_from_vector, vector_from_angles
from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Strength, heading
from cubestack.emulator.scene.hazards.sun_glare import SHARE, aureole
from cubestack.firmware_model.values import number, whole

PLACES = (-1.1, 0.5)
"""Range of a ghost's place, as a factor on the Sun's angles; negative: beyond the axis."""

WIDTHS = (0.005, 0.03)
"""Range of the standard deviation of a ghost's light, relative to the half field."""

REACH_SIGMAS = 4.0


@dataclass(frozen=True, kw_only=True)
class Ghosts(sky.SkyHazard):
    """Images that the lens makes of the Sun beside the sharp one."""

    sun: tuple[float, ...] | None = heading(
        None, "direction of the Sun; if omitted, that of the scene, if it has one"
    )
    share: float = number(1e-4, "of the Sun's light in the brightest ghost", 0, 1)
    count: int = whole(5, "ghosts, each with half the light of the previous one", 0, 50)
    scatter: float = number(SHARE, "share of the Sun's light that the lens scatters", 0, 0.2)

    meaning = "reflections of the Sun in the lens, and its glare"
    strength = Strength(
        "share", "of the Sun's light", (1e-7, 1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3), 1e-4
    )
    depth = sky.Depth.LENS

    @classmethod
    def sample(
        cls, strength: float, state: sky.CameraState, generator: np.random.Generator
    ) -> Self:
        """Of a Sun anywhere in the picture; the brightest ghost has this share of its light."""
        sun = tuple(state.random_direction(generator).tolist())
        return cls(share=strength, sun=sun, seed=int(generator.integers(2**31)))

    @property
    def bodies(self) -> tuple[sky.Body, ...]:
        if self.sun is None:
            return ()
        return (sky.Body("Sun", sky.direction("sun", self.sun), sky.SUN_RADIUS_DEG),)

    def glow(self, state: sky.CameraState, vectors: sky.Vectors) -> sky.Brightness:
        total = np.zeros(len(vectors), np.float32)
        if self.sun is None:
            return total
        sun = sky.direction("sun", self.sun)
        if np.degrees(sky.angles_rad(sun[None], state.boresight)[0]) > state.half_field_deg:
            return total
        light = 10 ** (-0.4 * sky.SUN_V)
        if self.scatter:
            total += (light * aureole(sky.angles_rad(vectors, sun), self.scatter)).astype(
                np.float32
            )
        for count, (centre, sigma) in enumerate(self._places(state, sun)):
            angles = sky.angles_rad(vectors, centre)
            near = np.flatnonzero(angles < REACH_SIGMAS * sigma)
            peak = light * self.share / 2**count / (2 * np.pi * sigma**2)
            total[near] += peak * np.exp(-0.5 * (angles[near] / sigma) ** 2)
        return total

    def rings(self, state: sky.CameraState) -> tuple[sky.Ring, ...]:
        if self.sun is None:
            return ()
        places = self._places(state, sky.direction("sun", self.sun))
        return tuple(sky.Ring(centre, 0.0, REACH_SIGMAS * sigma) for centre, sigma in places)

    def _places(self, state: sky.CameraState, sun: sky.Vectors) -> list[tuple[sky.Vectors, float]]:
        """Centre (3,) and standard deviation in radians of each ghost."""
        generator = np.random.default_rng([self.seed, 0x6057])
        angles = np.array(angles_from_vector(state.axes @ sun))
        places = generator.uniform(*PLACES, self.count)
        widths = np.radians(state.half_field_deg * generator.uniform(*WIDTHS, self.count))
        return [
            (np.asarray(vector_from_angles(*(place * angles)) @ state.axes), float(width))
            for place, width in zip(places, widths, strict=True)
        ]
