"""One frame of a scene on the MLX75412: its lens' light, its pixels' counts."""

import numpy as np

from cubestack.emulator.camera.common.imager import Grey, Imager, Light, hot_pixels
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412.pixel_array import Corrections, PixelArray, ideal_counts

__all__ = ["Mlx75412Imager"]


class Mlx75412Imager(Imager[Corrections]):
    """Renders frames of one sensor."""

    def __init__(self, seed: int = 0) -> None:
        """Make the imager with the sensor that ``seed`` stands for."""
        self._pixels = PixelArray(seed)

    def _counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: Corrections,
        generator: np.random.Generator | None,
    ) -> Grey:
        if generator is None:
            return ideal_counts(light)
        grown = None
        if condition.hot_pixels:
            grown = hot_pixels(condition.seed, condition.hot_pixels, light.size)
        return self._pixels.read_out(
            light, exposure_s, condition.temperature_c, settings, generator, grown
        )
