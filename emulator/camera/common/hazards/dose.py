"""What years of radiation leave in a sensor: dark current, much of it in some pixels.

Displacement damage: each pixel has a number of damage sources that Poisson's law gives, with a mean
proportional to damage and depleted volume, and each source adds a dark current that is distributed
exponentially, the same in all silicon: Virmontois, Goiffon et al., "Similarities between proton
and neutron induced dark current distribution in CMOS image sensors", IEEE TNS 59 (2012) 927. The
mean of both together agrees with the universal damage factor of Srour and Lo, "Universal damage
factor for radiation-induced dark current in silicon devices", IEEE TNS 47 (2000) 2451:
1.9e5 / (cm3 s) for each MeV/g at 300 K. Annealing, and pixels that switch between two dark
currents, are left out.

Ionisation: more generation at interfaces, in all pixels alike (Goiffon et al., IEEE TED 56 (2009)
2594).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.dark import doubled
from cubestack.emulator.camera.common.hazards.contract import Exposure, Field, SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number

SOURCES_PER_UM3 = 1 / 33_000
"""In each um3 of depleted silicon, for 1 TeV/g of displacement damage (published, rounded)."""

SOURCE_ELECTRONS_PER_S, SOURCE_C = 4500.0, 23.0
"""Mean of one source's dark current, and the temperature that it is of (published, rounded)."""

PROTON_TEV_G_PER_KRAD = 25.0
"""Damage of the protons that give 1 krad: of 50 MeV, 3.9e-3 by 9.9 MeV cm2/g."""

PROTON_SHARE = 0.1
"""Of the dose: assumed, in a low orbit behind 2 mm of aluminium; electrons give the rest."""

DEPLETED_UM = 3.0  # depth below each pixel, assumed
SURFACE_RISE_PER_KRAD = 0.3  # of the sensor's own dark current, assumed


@dataclass(frozen=True, kw_only=True)
class Dose(SensorHazard):
    """A sensor after a total dose; hot pixels by it are in the same places in every frame."""

    name: ClassVar[str] = "dose"
    meaning: ClassVar[str] = "hot pixels and dark current after a total dose, by temperature"
    strength: ClassVar[Strength] = Strength("krad", "krad", (0, 0.3, 1, 3, 5, 10), 5)

    krad: float = number(5.0, "total ionising dose in silicon", 0, 30, "krad")

    def dark_rise(self) -> float:
        """The mean rise, which the sensor's dark rows share."""
        return 1 + SURFACE_RISE_PER_KRAD * self.krad

    def sources_per_pixel(self, pitch_um: float) -> float:
        """Mean number of damage sources in a pixel."""
        damage = self.krad * PROTON_SHARE * PROTON_TEV_G_PER_KRAD
        return SOURCES_PER_UM3 * pitch_um**2 * DEPLETED_UM * damage

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        """Dark charge of all sources in this frame."""
        del generator
        mean = SOURCE_ELECTRONS_PER_S * exposure.seconds
        mean = doubled(mean, exposure.temperature_c, SOURCE_C)
        sources = self.sources_per_pixel(exposure.pitch_um)
        image: Field = np.zeros(exposure.shape, np.float32)
        places, strengths = _sources(self.seed, sources, image.size)
        np.add.at(image.ravel(), places, strengths * np.float32(mean))
        return image


@lru_cache(maxsize=4)
def _sources(seed: int, mean: float, pixels: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Flat indices of the damage sources, and their strengths by the mean strength."""
    generator = np.random.default_rng([seed, 0xD05E])
    count = generator.poisson(mean * pixels)
    places = generator.integers(0, pixels, count)
    return places, generator.exponential(size=count).astype(np.float32)
