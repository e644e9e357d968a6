"""Pixels that differ from each other: hot pixels, and an uneven response."""

import math
from dataclasses import dataclass

import numpy as np

from cubestack.emulator.camera.common.hazards.contract import Field, SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number, whole

DUST_PX = (3.0, 15.0)
"""Radii of the shadows of dust that lies a few pixels in front of the sensor (chosen)."""

DUST_SHARE = 5.0
"""Depth of the deepest shadow in standard deviations of the pixels' response (chosen)."""


@dataclass(frozen=True, kw_only=True)
class HotPixels(SensorHazard):
    """More hot pixels, of the same kind as those of the condition's key ``hot_pixels``."""

    meaning = "pixels made hot by radiation"
    strength = Strength("count", "", (0, 300, 1000, 3000, 10_000, 20_000))

    count: int = whole(1000, "number of hot pixels beside those of the key `hot_pixels`", 0, 75_000)

    def hot_pixels(self) -> int:
        return self.count


@dataclass(frozen=True, kw_only=True)
class Response(SensorHazard):
    """Gain that differs between pixels and between columns, and shadows of dust.

    Image sensors have about 1 % between pixels (EMVA standard 1288, photo response non-uniformity).
    """

    meaning = "uneven response of pixels and columns, shadows of dust"
    strength = Strength("percent", "%", (0, 0.5, 1, 2, 4, 8), 4)

    percent: float = number(1.0, "standard deviation of the pixels' gain, per cent", 0, 30)
    columns_percent: float | None = number(
        None, "of the columns' gain; if omitted, half of `percent`", 0, 30
    )
    dust: int = whole(10, "number of shadows, each up to five times `percent` deep", 0, 1000)

    def response(self, shape: tuple[int, int]) -> Field | None:
        """Gain (rows, columns), 1 on average, at least 0."""
        generator = np.random.default_rng([self.seed, 0x926])
        rows, columns = shape
        sigma = self.percent / 100
        across = sigma / 2 if self.columns_percent is None else self.columns_percent / 100
        gain = 1 + np.float32(sigma) * generator.standard_normal(shape, np.float32)
        gain *= 1 + np.float32(across) * generator.standard_normal((1, columns), np.float32)
        places = generator.random((self.dust, 2)) * (columns, rows)
        radii = generator.uniform(*DUST_PX, self.dust)
        depths = np.minimum(DUST_SHARE * sigma * generator.random(self.dust), 1)
        for (x, y), radius, depth in zip(places, radii, depths, strict=True):
            reach = math.ceil(3 * radius)
            left, top = max(0, int(x) - reach), max(0, int(y) - reach)
            patch = gain[top : int(y) + reach + 1, left : int(x) + reach + 1]
            down, over = np.ogrid[: patch.shape[0], : patch.shape[1]]
            distance2 = (over + left - x) ** 2 + (down + top - y) ** 2
            # Nearly uniform inside, as the shadow of a disc in a wide beam.
            patch *= (1 - depth * np.exp(-((distance2 / radius**2) ** 2))).astype(np.float32)
        uneven: Field = np.maximum(gain, 0)
        return uneven
