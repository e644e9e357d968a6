"""Effects of years of radiation on a sensor: dark current, much of it concentrated in some pixels.

Displacement damage: the number of damage sources in a pixel has a Poisson distribution with a mean
proportional to damage and depleted volume; the dark current of a source has an exponential
distribution, the same in all silicon: Virmontois, Goiffon et al., "Similarities between proton
and neutron induced dark current distribution in CMOS image sensors", IEEE TNS 59 (2012) 927. The
mean of both together agrees with the universal damage factor of Srour and Lo, "Universal damage
factor for radiation-induced dark current in silicon devices", IEEE TNS 47 (2000) 2451:
1.9e5 / (cm3 s) for each MeV/g at 300 K. Not modelled: annealing, and pixels that switch between two
dark currents.

Ionisation: more generation at interfaces, the same in all pixels (Goiffon et al., IEEE TED 56
(2009) 2594).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.dark import dark_at
from cubestack.emulator.camera.common.hazards.contract import Exposure, Field, SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number

SOURCES_PER_UM3 = 1 / 33_000
"""In each um3 of depleted silicon, for 1 TeV/g of displacement damage (published, rounded)."""

SOURCE_ELECTRONS_PER_S, SOURCE_C = 4500.0, 23.0
"""Mean dark current of a source, and its temperature (published, rounded)."""

PROTON_TEV_G_PER_KRAD = 25.0
"""Damage by protons that give 1 krad: of 50 MeV, 3.9e-3 by 9.9 MeV cm2/g."""

PROTON_SHARE = 0.1
"""Share of protons in the dose, the rest being electrons (assumed: low orbit, 2 mm aluminium)."""

DEPLETED_UM = 3.0  # depth below each pixel, assumed
SURFACE_RISE_PER_KRAD = 0.3  # of the sensor's own dark current, assumed


@dataclass(frozen=True, kw_only=True)
class Dose(SensorHazard):
    """A sensor after a total dose; its hot pixels are in the same places in every frame."""

    meaning = "hot pixels and dark current after a total dose, by temperature"
    strength = Strength("krad", "krad", (0, 0.3, 1, 3, 5, 10), 5)

    krad: float = number(5.0, "total ionising dose in silicon", 0, 30, "krad")

    def dark_rise(self) -> float:
        """Factor on the dark current of all pixels, the sensor's dark rows included."""
        return 1 + SURFACE_RISE_PER_KRAD * self.krad

    def sources_per_pixel(self, pitch_um: float) -> float:
        damage = self.krad * PROTON_SHARE * PROTON_TEV_G_PER_KRAD
        return SOURCES_PER_UM3 * pitch_um**2 * DEPLETED_UM * damage

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        del generator
        mean = SOURCE_ELECTRONS_PER_S * exposure.seconds
        mean = dark_at(mean, exposure.temperature_c, SOURCE_C)
        sources = self.sources_per_pixel(exposure.pitch_um)
        image: Field = np.zeros(exposure.shape, np.float32)
        places, strengths = _sources(self.seed, sources, image.size)
        np.add.at(image.ravel(), places, strengths * np.float32(mean))
        return image


@lru_cache(maxsize=4)
def _sources(seed: int, mean: float, pixels: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Flat indices of the damage sources, and their strengths relative to the mean strength."""
    generator = np.random.default_rng([seed, 0xD05E])
    count = generator.poisson(mean * pixels)
    places = generator.integers(0, pixels, count)
    return places, generator.exponential(size=count).astype(np.float32)
