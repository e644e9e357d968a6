"""Hazards of light: what makes real skies hard for star and Earth sensors; one module a kind.

``SKY_HAZARDS`` is the one list of them, by name.
"""

from cubestack.emulator.scene.hazards.aberration import Aberration
from cubestack.emulator.scene.hazards.contract import Lights, Looking, SkyHazard
from cubestack.emulator.scene.hazards.debris import Debris
from cubestack.emulator.scene.hazards.earth_limb import EarthLimb
from cubestack.emulator.scene.hazards.hazard import Hazard, Strength
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.hazards.planets import Planets
from cubestack.emulator.scene.hazards.sky_glow import SkyGlow
from cubestack.emulator.scene.hazards.sun_glare import SunGlare

__all__ = [
    "SKY_HAZARDS",
    "Aberration",
    "Debris",
    "EarthLimb",
    "Hazard",
    "Lights",
    "Looking",
    "Moon",
    "Planets",
    "SkyGlow",
    "SkyHazard",
    "Strength",
    "SunGlare",
]

SKY_HAZARDS: dict[str, type[SkyHazard]] = {
    kind.name: kind for kind in (Moon, Planets, EarthLimb, SunGlare, SkyGlow, Debris, Aberration)
}
