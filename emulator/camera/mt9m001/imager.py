"""One frame of a scene on the MT9M001: its lens' light, its noise, its window."""

from dataclasses import replace

import numpy as np

from cubestack.emulator.camera.common.imager import Grey, Imager, Light, hot_pixels
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mt9m001.noise import (
    BLACK_LEVEL,
    HOT_SHARE,
    NoiseTerms,
    Surroundings,
    counts,
)
from cubestack.emulator.camera.mt9m001.registers import SensorSettings
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS

__all__ = ["Mt9m001Imager"]


class Mt9m001Imager(Imager[SensorSettings]):
    """Renders frames of one sensor's window."""

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
        self,
        scene: Scene,
        condition: SkyCondition,
        shutter: RollingShutter,
        settings: SensorSettings,
    ) -> Grey:
        """Grey values of the window; row 0 of ``shutter`` is the window's first."""
        # The array's row 0 has the time that it would have if it were read.
        readout_ps = shutter.readout_ps - round(settings.row * shutter.line_ps)
        whole = replace(shutter, readout_ps=readout_ps)
        return _window(super().picture(scene, condition, whole, settings), settings)

    def _counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: SensorSettings,
        generator: np.random.Generator | None,
    ) -> Grey:
        hot = None
        if condition.hot_pixels:
            seed = condition.seed + self._seed
            hot = hot_pixels(seed, condition.hot_pixels, light.size, HOT_SHARE)
        surroundings = Surroundings(condition.temperature_c, self._background)
        noise = NoiseTerms.none() if generator is None else self._noise
        return counts(light, exposure_s, _gain(settings), surroundings, noise, generator, hot)


def _gain(settings: SensorSettings) -> float | Light:
    """One gain for all pixels, or one for each (1024, 1280)."""
    even, odd_row, odd_column, odd = settings.gains
    if even == odd_row == odd_column == odd:
        return even
    # Even and odd are counted in the window (assumed), whose start is even in the array.
    gains = np.array([[even, odd_column], [odd_row, odd]], np.float32)
    return np.roll(np.tile(gains, (ROWS // 2, COLUMNS // 2)), settings.row, axis=0)


def _window(full: Grey, settings: SensorSettings) -> Grey:
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
