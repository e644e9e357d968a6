"""Pixels that are not alike: hot ones, and an uneven response."""

from dataclasses import dataclass
from typing import ClassVar

from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength, key


@dataclass(frozen=True, kw_only=True)
class HotPixels(SensorHazard):
    """More of the pixels that the condition's key ``hot_pixels`` counts, and hot as those."""

    name: ClassVar[str] = "hot-pixels"
    meaning: ClassVar[str] = "pixels that radiation has made hot, by their number"
    strength: ClassVar[Strength] = Strength("count", "", (0, 300, 1000, 3000, 10_000, 20_000))

    count: int = key(1000, "number of hot pixels beside those of the key `hot_pixels`", 0, 100_000)

    def hot(self) -> int:
        """All of them."""
        return self.count
