"""One frame of a scene on the MT9M001: its lens' light, its noise, its window."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412.imager import photograph
from cubestack.emulator.camera.mt9m001.noise import (
    BLACK_LEVEL,
    NoiseTerms,
    Surroundings,
    counts,
    hot_pixels,
)
from cubestack.emulator.camera.mt9m001.registers import SensorSettings
from cubestack.emulator.scene.sky import PictureScene, Scene, SkyScene
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS

__all__ = ["Mt9m001Imager"]


class Mt9m001Imager:
    """Renders frames. The same scene, frame time and settings give the same picture."""

    def __init__(
        self, seed: int, noise: NoiseTerms, background_electrons_per_s: float | None
    ) -> None:
        """Make the imager with the sensor that ``seed`` stands for, and these terms of noise."""
        self._seed = seed
        self._noise = noise
        usual = Surroundings().background_electrons_per_s
        self._background = (
            usual if background_electrons_per_s is None else background_electrons_per_s
        )

    def picture(
        self, scene: Scene, shutter: RollingShutter, settings: SensorSettings
    ) -> NDArray[np.uint8]:
        """Grey values of the window (rows, columns), C-contiguous."""
        # The array's row 0 has the time that it would have if it were read.
        readout_ps = shutter.readout_ps - round(settings.row * shutter.line_ps)
        whole = RollingShutter(
            readout_ps, shutter.line_ps, shutter.exposure_lines, shutter.programmed_lines
        )
        match scene:
            case SkyScene():
                full = self._sky(scene, whole, settings)
            case PictureScene():
                full = photograph(scene, whole)
        return _window(full, settings)

    def _sky(
        self, scene: SkyScene, shutter: RollingShutter, settings: SensorSettings
    ) -> NDArray[np.uint8]:
        light = star_light(scene, shutter)
        noise = self._noise if scene.noise else NoiseTerms.none()
        surroundings = Surroundings(scene.temperature_c, self._background)
        # By frame time, so that a frame nobody looked at does not change the next one's noise.
        generator = np.random.Generator(np.random.SFC64([scene.seed, max(0, shutter.readout_ps)]))
        hot = _hot(scene.seed + self._seed, scene.hot_pixels) if scene.hot_pixels else None
        return counts(
            light, shutter.exposure_s, _gain(settings), surroundings, noise, generator, hot
        )


@lru_cache(maxsize=8)
def _hot(seed: int, count: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    return hot_pixels(seed, count, ROWS * COLUMNS)


def _gain(settings: SensorSettings) -> float | NDArray[np.float32]:
    """One gain for all pixels, or one for each (1024, 1280)."""
    even, odd_row, odd_column, odd = settings.gains
    if even == odd_row == odd_column == odd:
        return even
    # Even and odd are counted in the window (assumed), whose start is even in the array.
    gains = np.array([[even, odd_column], [odd_row, odd]], np.float32)
    return np.roll(np.tile(gains, (ROWS // 2, COLUMNS // 2)), settings.row, axis=0)


def _window(full: NDArray[np.uint8], settings: SensorSettings) -> NDArray[np.uint8]:
    if (settings.row, settings.column) == (0, 0) and full.shape == (
        settings.rows,
        settings.columns,
    ):
        return full
    window = np.full((settings.rows, settings.columns), BLACK_LEVEL >> 2, np.uint8)
    top, left = max(0, settings.row), max(0, settings.column)
    bottom = min(ROWS, settings.row + settings.rows)
    right = min(COLUMNS, settings.column + settings.columns)
    if top < bottom and left < right:
        y, x = top - settings.row, left - settings.column
        window[y : y + bottom - top, x : x + right - left] = full[top:bottom, left:right]
    return window
