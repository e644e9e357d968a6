"""Renders frames of the MT9M001: light, noise, window.

Shot, dark, background and read-out noise are drawn at once, as one normal distribution with the
mean and the variance of their sum.
"""

from dataclasses import replace

import numpy as np

from cubestack.emulator.camera.common.dark import hot_pixels
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.imager import Grey, Imager, Light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mt9m001 import noise as physics
from cubestack.emulator.camera.mt9m001.registers import SensorSettings
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS

COUNTS = 256  # eight bits are wired


class Mt9m001Imager(Imager[SensorSettings]):
    """Renders frames of one sensor's window."""

    def __init__(
        self,
        seed: int = 0,
        noise: physics.NoiseTerms | None = None,
        background_electrons_per_s: float = physics.BACKGROUND_ELECTRONS_PER_S,
    ) -> None:
        """Create the imager.

        Args:
            seed: seed of the part's hot pixels.
            noise: terms of the noise under a condition with noise; default all.
            background_electrons_per_s: background light in each pixel.
        """
        self._seed = seed
        self._noise = noise or physics.NoiseTerms()
        self._background = background_electrons_per_s

    def render(
        self,
        scene: Scene,
        condition: SkyCondition,
        shutter: RollingShutter,
        settings: SensorSettings,
    ) -> Grey:
        """Grey values of the window; row 0 of ``shutter`` is the window's first."""
        # Time at which the array's row 0 would be read out.
        readout_ps = shutter.readout_ps - round(settings.row * shutter.line_ps)
        whole = replace(shutter, readout_ps=readout_ps)
        return _window(super().render(scene, condition, whole, settings), settings)

    def electrons_per_count(self, settings: SensorSettings) -> float:
        """For the mean of the four gains; see ``Imager``."""
        return physics.FULL_WELL_ELECTRONS / (COUNTS * float(np.mean(settings.gains)))

    def counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: SensorSettings,
        generator: np.random.Generator | None,
    ) -> Grey:
        terms = physics.NoiseTerms.none() if generator is None else self._noise
        surplus = self._background * exposure_s if terms.background else 0.0
        own_dark = physics.dark_electrons_per_s(condition.temperature_c) * exposure_s
        dark = own_dark * effects.dark_rise(condition.hazards)
        if terms.dark:
            surplus += dark
        mean = light + np.float32(surplus)
        if terms.dark and condition.hot_count:
            seed = condition.seed + self._seed
            places, share = hot_pixels(seed, condition.hot_count, light.size, physics.HOT_SHARE)
            mean.ravel()[places] += share * np.float32(own_dark)
        steady = physics.READ_NOISE_ELECTRONS**2 if terms.readout else 0.0
        exposure = self.exposure((ROWS, COLUMNS), exposure_s, condition, settings)
        steady += effects.variance(condition.hazards, exposure)
        variance = (mean if terms.shot else mean - light) + np.float32(steady)
        signal = mean
        if generator is not None and (terms.shot or surplus or steady):
            noise = generator.standard_normal(light.shape, np.float32)
            noise *= np.sqrt(variance)
            signal += noise
        # The chip subtracts the mean of the dark rows, which contains the mean dark current.
        if terms.dark:
            signal -= np.float32(dark)
        scale = (physics.FULL_SCALE + 1) / physics.FULL_WELL_ELECTRONS
        signal *= _gain(settings) * np.float32(scale)
        signal += np.float32(physics.BLACK_LEVEL)
        if not terms.quantisation:
            signal /= np.float32(4)
            nearest: Light = np.clip(signal + np.float32(0.5), 0, physics.FULL_SCALE // 4)
            return nearest.astype(np.uint8)
        whole: Light = np.clip(signal + np.float32(0.5), 0, physics.FULL_SCALE)
        return (whole.astype(np.uint16) >> 2).astype(np.uint8)


def _gain(settings: SensorSettings) -> float | Light:
    even, odd_row, odd_column, odd = settings.gains
    if even == odd_row == odd_column == odd:
        return even
    # Even and odd refer to the window (assumed), whose start is even in the array.
    gains = np.array([[even, odd_column], [odd_row, odd]], np.float32)
    return np.roll(np.tile(gains, (ROWS // 2, COLUMNS // 2)), settings.row, axis=0)


def _window(full: Grey, settings: SensorSettings) -> Grey:
    shape = (settings.rows, settings.columns)
    if (settings.row, settings.column) == (0, 0) and full.shape == shape:
        return full
    window = np.full(shape, physics.BLACK_LEVEL >> 2, np.uint8)
    top, left = max(0, settings.row), max(0, settings.column)
    bottom = min(ROWS, settings.row + settings.rows)
    right = min(COLUMNS, settings.column + settings.columns)
    if top < bottom and left < right:
        y, x = top - settings.row, left - settings.column
        window[y : y + bottom - top, x : x + right - left] = full[top:bottom, left:right]
    return window
