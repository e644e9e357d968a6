"""Hazards of sensor and lens, for all cameras."""

from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.hazards.dose import Dose
from cubestack.emulator.camera.common.hazards.lenses import (
    Defocus,
    FocalLength,
    LensResiduals,
    PixelAspect,
    PixelSkew,
    PrincipalPoint,
    RadialDistortion,
    Wobble,
)
from cubestack.emulator.camera.common.hazards.pixels import HotPixels, Response
from cubestack.emulator.camera.common.hazards.protons import Protons
from cubestack.emulator.camera.common.hazards.veils import Background, Gradient

HAZARDS: dict[str, type[SensorHazard]] = {
    hazard.name: hazard
    for hazard in (
        Protons,
        Dose,
        HotPixels,
        Response,
        Defocus,
        FocalLength,
        LensResiduals,
        PixelAspect,
        PixelSkew,
        PrincipalPoint,
        RadialDistortion,
        Wobble,
        Gradient,
        Background,
    )
}
"""All hazards, by the names in scene files, on the command line and in documents."""
