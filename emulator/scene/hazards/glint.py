"""Glint: sunlit structure of the satellite at the border of the field, always at the same place.

Brightness is relative to the Sun's surface: a mirror shows 1 of it, glass 0.04 (Fresnel), a white
surface that scatters it 1.5e-5 (albedo 0.7). Each patch is a bar with sharp ends; places, lengths
and widths are random (assumed).
"""

import math
from dataclasses import dataclass

import numpy as np

from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number, whole

SUN_RADIUS_RAD = math.radians(0.2666)
SUN_SURFACE = 10 ** (-0.4 * sky.SUN_V) / (math.pi * SUN_RADIUS_RAD**2)
"""Brightness of the Sun's disc, V = 0 stars per steradian."""

PLACES = (0.7, 0.98)
LENGTHS, WIDTHS = (0.01, 0.15), (0.004, 0.02)
"""Distance from the boresight, half length, half width of a patch, in half fields: ranges."""


@dataclass(frozen=True, kw_only=True)
class Glint(sky.SkyHazard):
    """Bright patches at a fixed place in the picture."""

    surface: float = number(1e-4, "brightness relative to the Sun's surface", 0, 1)
    count: int = whole(2, "patches", 0, 50)

    meaning = "sunlit structure at the border of the field"
    strength = Strength(
        "surface", "of the Sun's surface", (1e-7, 1e-6, 1e-5, 1e-4, 1e-2, 0.1, 1.0), 1e-4
    )
    depth = sky.Depth.LENS

    def glow(self, state: sky.CameraState, vectors: sky.Vectors) -> sky.Brightness:
        """The patches, each with an edge one pixel wide."""
        total = np.zeros(len(vectors), np.float32)
        for centre, along, across, length, width in self._patches(state):
            near = np.flatnonzero(vectors @ centre > math.cos(length + width + state.pixel_rad))
            beside = [np.abs(vectors[near] @ side) for side in (along, across)]
            share = np.ones(len(near))
            for distance, half in zip(beside, (length, width), strict=True):
                share *= np.clip((half - distance) / state.pixel_rad + 0.5, 0, 1)
            total[near] = np.maximum(total[near], self.surface * SUN_SURFACE * share)
        return total

    def rings(self, state: sky.CameraState) -> tuple[sky.Ring, ...]:
        patches = self._patches(state)
        return tuple(
            sky.Ring(centre, 0.0, length + width) for centre, _, _, length, width in patches
        )

    def _patches(
        self, state: sky.CameraState
    ) -> list[tuple[sky.Vectors, sky.Vectors, sky.Vectors, float, float]]:
        """Centre, two sides (3,) each, half length and half width in rad of each patch."""
        generator = np.random.default_rng([self.seed, 0x611E7])
        patches = []
        for _ in range(self.count):
            around, turn = generator.uniform(0, 2 * math.pi, 2)
            away = state.half_field_deg * generator.uniform(*PLACES)
            camera = vector_from_angles(away * math.cos(around), away * math.sin(around))
            one = np.cross(camera, np.eye(3)[np.argmin(np.abs(camera))])
            one /= np.linalg.norm(one)
            other = np.cross(camera, one)
            along = math.cos(turn) * one + math.sin(turn) * other
            sizes = [state.half_field_deg * generator.uniform(*of) for of in (LENGTHS, WIDTHS)]
            length, width = (math.radians(size) for size in sizes)
            one, two, three = (v @ state.axes for v in (camera, along, np.cross(camera, along)))
            patches.append((one, two, three, length, width))
        return patches
