"""One frame of a scene on the MLX75412: its lens' light, its pixels' counts."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412.pixel_array import (
    Corrections,
    PixelArray,
    grown_hot_pixels,
    ideal_counts,
)
from cubestack.emulator.scene.sky import PictureScene, Scene, SkyScene

__all__ = ["Imager", "photograph"]


class Imager:
    """Renders frames. The same scene, frame time and seed give the same picture."""

    def __init__(self, seed: int = 0) -> None:
        """Make the imager with the sensor that ``seed`` stands for."""
        self._pixels = PixelArray(seed)

    def picture(
        self, scene: Scene, shutter: RollingShutter, corrections: Corrections
    ) -> NDArray[np.uint8]:
        """Grey values (512, 1024), C-contiguous."""
        match scene:
            case SkyScene():
                return self._sky(scene, shutter, corrections)
            case PictureScene():
                return photograph(scene, shutter)

    def _sky(
        self, scene: SkyScene, shutter: RollingShutter, corrections: Corrections
    ) -> NDArray[np.uint8]:
        light = star_light(scene, shutter)
        if not scene.noise:
            return ideal_counts(light)
        # By frame time, so that a frame nobody looked at does not change the next one's noise.
        generator = np.random.Generator(np.random.SFC64([scene.seed, shutter.readout_ps]))
        return self._pixels.read_out(
            light,
            shutter.exposure_s,
            scene.temperature_c,
            corrections,
            generator,
            _grown(scene.seed, scene.hot_pixels) if scene.hot_pixels else None,
        )


_grown = lru_cache(maxsize=8)(grown_hot_pixels)


def photograph(scene: PictureScene, shutter: RollingShutter) -> NDArray[np.uint8]:
    """A picture's grey values (rows, columns), scaled where its own exposure is known."""
    scale = shutter.relative_exposure
    if scene.exposure_ms is not None:
        scale = 1000 * shutter.exposure_s / scene.exposure_ms
    if scale == 1:
        return scene.pixels
    scaled: NDArray[np.float32] = np.clip(scene.pixels * np.float32(scale), 0, 255)
    return scaled.astype(np.uint8)
