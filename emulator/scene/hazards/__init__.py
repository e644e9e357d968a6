"""Hazards of light: what makes real skies hard for star and Earth sensors; one module per kind.

``SKY_HAZARDS`` has those that any camera can meet, by name; ``EARTH_HAZARDS`` those that need an
Earth below the satellite.
"""

from cubestack.emulator.scene.hazards.aberration import Aberration
from cubestack.emulator.scene.hazards.contract import SkyHazard
from cubestack.emulator.scene.hazards.debris import Debris
from cubestack.emulator.scene.hazards.earth_below import (
    Clouds,
    EarthHazard,
    EarthInSunCamera,
    Terminator,
)
from cubestack.emulator.scene.hazards.earth_limb import EarthLimb
from cubestack.emulator.scene.hazards.ghosts import Ghosts
from cubestack.emulator.scene.hazards.glint import Glint
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.hazards.planets import Planets
from cubestack.emulator.scene.hazards.sky_glow import SkyGlow
from cubestack.emulator.scene.hazards.sun_glare import SunGlare

SKY_HAZARDS: dict[str, type[SkyHazard]] = {
    kind.name: kind
    for kind in (Moon, Planets, EarthLimb, SunGlare, SkyGlow, Debris, Aberration, Ghosts, Glint)
}

EARTH_HAZARDS: dict[str, type[EarthHazard]] = {
    kind.name: kind for kind in (Clouds, Terminator, EarthInSunCamera)
}
