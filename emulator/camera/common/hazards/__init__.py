"""What makes pictures hard in sensor and lens, for all cameras."""

from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.hazards.pixels import HotPixels

HAZARDS: dict[str, type[SensorHazard]] = {hazard.name: hazard for hazard in (HotPixels,)}
"""All of them by name: what scene files, the command line and documents know."""
