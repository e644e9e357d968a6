"""Hazards of light: what makes real skies hard for star and Earth sensors; one module a kind.

``SKY_HAZARDS`` is the one list of them, by name.
"""

from cubestack.emulator.scene.hazards.contract import Lights, Looking, SkyHazard
from cubestack.emulator.scene.hazards.hazard import Hazard, Strength
from cubestack.emulator.scene.hazards.moon import Moon

__all__ = ["SKY_HAZARDS", "Hazard", "Lights", "Looking", "Moon", "SkyHazard", "Strength"]

SKY_HAZARDS: dict[str, type[SkyHazard]] = {kind.name: kind for kind in (Moon,)}
