"""Renders frames of the MT9M001: light, noise from electrons to eight bits, window.

AraMiS thesis, section 3.4: shot noise of the stars' light (equation 3.3), dark current (3.4),
background, quantisation (3.5, 3.6) and read-out noise (3.7), added as variances (3.8). Each term
can be switched off. MT9M001 data sheet, key performance: a signal to noise ratio of at most 45 dB
and a dynamic range of 68.2 dB, from which the full well (its square root is that ratio) and the
read-out noise follow. Values that neither publishes are marked as assumed.

Shot, dark, background and read-out noise are drawn as one normal number (`emulator.light.pixels`).
"""

from dataclasses import dataclass, replace

import numpy as np

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.imager import Imager
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mt9m001.registers import SensorSettings
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import NO_CHARGE, NOWHERE, Grey, Light, PixelModel
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS

FULL_WELL_ELECTRONS = 10 ** (45 / 10)
READ_NOISE_ELECTRONS = FULL_WELL_ELECTRONS / 10 ** (68.2 / 20)

COUNTS = 256  # eight bits are wired
FULL_SCALE = 1023
"""Full scale of the converter, 10 bits, of which the upper 8 are wired."""

BLACK_LEVEL = 6
"""In counts of 10 bits: between thresholds 4 and 9 of the sensor's calibration (assumed)."""

BACKGROUND_ELECTRONS_PER_S = 15.0
"""Per pixel: a dark sky of 22 mag/arcsec2 and the same amount of stray light (assumed)."""

DARK_ELECTRONS_PER_S_AT_25_C = 50.0  # assumed
HOT_SHARE = 500.0  # assumed: mean dark current of hot pixels relative to the others


@dataclass(frozen=True)
class NoiseTerms:
    """The terms of equation 3.8 that are on."""

    shot: bool = True  # noise of the stars' light
    dark: bool = True  # dark current, hot pixels and their noise
    background: bool = True  # background light and its noise
    # the converter's 10 bits, of which 8 are wired; off: the nearest of 256 counts, the smallest
    # error with eight bits
    quantisation: bool = True
    readout: bool = True  # noise of the amplifiers

    @classmethod
    def none(cls) -> "NoiseTerms":
        return cls(shot=False, dark=False, background=False, quantisation=False, readout=False)


def dark_electrons_per_s(temperature_c: float) -> float:
    return dark_at(DARK_ELECTRONS_PER_S_AT_25_C, temperature_c, 25.0)


class Mt9m001Imager(Imager[SensorSettings]):
    """Renders frames of one sensor's window."""

    def __init__(
        self,
        seed: int = 0,
        noise: NoiseTerms | None = None,
        background_electrons_per_s: float = BACKGROUND_ELECTRONS_PER_S,
    ) -> None:
        """Create the imager.

        Args:
            seed: seed of the part's hot pixels.
            noise: terms of the noise under a condition with noise; default all.
            background_electrons_per_s: background light in each pixel.
        """
        self._seed = seed
        self._noise = noise or NoiseTerms()
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
        return FULL_WELL_ELECTRONS / (COUNTS * float(np.mean(settings.gains)))

    def pixels(
        self,
        shape: tuple[int, int],
        exposure_s: float,
        condition: SkyCondition,
        settings: SensorSettings,
        noise: FrameNoise | None,
    ) -> PixelModel:
        terms = NoiseTerms.none() if noise is None else self._noise
        surplus = self._background * exposure_s if terms.background else 0.0
        own_dark = dark_electrons_per_s(condition.temperature_c) * exposure_s
        dark = own_dark * effects.dark_rise(condition.hazards) if terms.dark else 0.0
        hot, hot_charge = NOWHERE, NO_CHARGE
        if terms.dark:
            seed = condition.seed + self._seed
            hot, share = hot_pixels(seed, condition.hot_count, shape[0] * shape[1], HOT_SHARE)
            order = np.argsort(hot)
            hot, hot_charge = hot[order], share[order] * np.float32(own_dark)
        steady = READ_NOISE_ELECTRONS**2 if terms.readout else 0.0
        exposure = self.exposure((ROWS, COLUMNS), exposure_s, condition, settings)
        steady += effects.variance(condition.hazards, exposure)
        # Eight of ten bits are wired; without quantisation, they are the nearest.
        full_scale, step = (FULL_SCALE, 0.25) if terms.quantisation else (FULL_SCALE // 4, 1.0)
        per_count = 0.25 / step
        scale = (FULL_SCALE + 1) / FULL_WELL_ELECTRONS * per_count
        return PixelModel(
            dark=surplus + dark,
            hot=hot,
            hot_charge=hot_charge,
            noise=noise if terms.shot or surplus + dark or steady else None,
            shot_of_light=terms.shot,
            steady=steady,
            # The chip subtracts the mean of the dark rows, which contains the mean dark current.
            black=dark,
            gain=_gains(settings, shape[1]) * np.float32(scale),
            offset=BLACK_LEVEL * per_count,
            full_scale=full_scale,
            step=step,
        )


def _gains(settings: SensorSettings, columns: int) -> Light:
    """Gain (2, columns) of the array's even and odd rows."""
    # Even and odd refer to the window (assumed), whose start is even in the array.
    even, odd_row, odd_column, odd = settings.gains
    gains = np.array([[even, odd_column], [odd_row, odd]], np.float32)
    return np.tile(np.roll(gains, settings.row, axis=0), (1, columns // 2))


def _window(full: Grey, settings: SensorSettings) -> Grey:
    shape = (settings.rows, settings.columns)
    if (settings.row, settings.column) == (0, 0) and full.shape == shape:
        return full
    window = np.full(shape, BLACK_LEVEL >> 2, np.uint8)
    top, left = max(0, settings.row), max(0, settings.column)
    bottom = min(ROWS, settings.row + settings.rows)
    right = min(COLUMNS, settings.column + settings.columns)
    if top < bottom and left < right:
        y, x = top - settings.row, left - settings.column
        window[y : y + bottom - top, x : x + right - left] = full[top:bottom, left:right]
    return window
