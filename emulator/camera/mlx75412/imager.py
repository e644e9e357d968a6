"""Renders frames of the MLX75412: electrons to 8-bit counts, with noise and defects.

CubeStar thesis, section 3.4.4 (dark current and its subtraction), appendix C (upper 8 of 12 bits)
and appendix E: 2.28 electrons per count of 12 bits, dark signal of 1008 counts per second at 65 C.
Read noise, fixed pattern, defects and the dark signal's dependence on temperature are not
published; these constants are assumed, typical of automotive sensors of that time.

Shot, dark and read noise are drawn as one normal number (`emulator.light.pixels`), which neglects
the skewness of the Poisson part. With this read noise it is at most 0.034.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.imager import Imager
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412.remap import Remap, remapped
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import NOWHERE, Grey, Light, Most, PixelModel
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS

ELECTRONS_PER_DN12 = 2.28  # per count of 12 bits (published)
FULL_SCALE_DN12 = 4095  # the converter saturates here
DN12_PER_DN8 = 16  # only the upper 8 of 12 bits are wired (appendix C)
DARK_DN12_PER_S_AT_65_C = 1008.0  # published
DARK_NON_UNIFORMITY = 0.1  # assumed: standard deviation, relative
READ_NOISE_ELECTRONS = 11.4  # assumed: 5 counts of 12 bits
GAIN_NON_UNIFORMITY = 0.005  # assumed: standard deviation, relative
COLUMN_PATTERN_DN12 = 4.0  # assumed: "very faint vertical noise" (appendix C), standard deviation
PIXEL_PATTERN_DN12 = 2.0  # assumed: standard deviation
PATTERN_LEFT = 0.1  # assumed: share of the pattern that the on-chip correction leaves
FACTORY_DEAD = 30  # assumed: pixels without light, known to the sensor
FACTORY_HOT = 30  # assumed: pixels with much dark current, known to the sensor
HOT_DN12_PER_S_AT_20_C = 1500.0  # assumed: mean of an exponential distribution


@dataclass(frozen=True)
class Corrections:
    """The sensor's corrections that are on."""

    defects: bool = True  # known defective pixels get the mean of their neighbours in the row
    fixed_pattern: bool = True  # most of the fixed pattern is subtracted
    dark: bool = True  # the mean of the dark rows is subtracted
    remap: Remap = Remap.UPPER_BITS  # from 12 bits to 8


def dark_dn12_per_second(temperature_c: float) -> float:
    """Mean dark signal in counts of 12 bits per second."""
    return dark_at(DARK_DN12_PER_S_AT_65_C, temperature_c, 65.0)


IDEAL = PixelModel(gain=1 / ELECTRONS_PER_DN12, full_scale=FULL_SCALE_DN12, step=1 / DN12_PER_DN8)
"""Pixels without noise and defects: whole counts of 12 bits, saturated, of which the upper 8."""


class Mlx75412Imager(Imager[Corrections]):
    """Renders frames of the sensor with fixed pattern and defects number ``seed``."""

    def __init__(self, seed: int = 0) -> None:
        generator = np.random.default_rng([seed, 0xD1E])
        shape = (ROWS, COLUMNS)

        def field(sigma: float, shape: tuple[int, ...] = shape) -> Light:
            return np.float32(sigma) * generator.standard_normal(shape, np.float32)

        self._gain = 1 + field(GAIN_NON_UNIFORMITY)
        self._dark_share = np.maximum(1 + field(DARK_NON_UNIFORMITY), 0)
        self._pattern = field(COLUMN_PATTERN_DN12, (1, COLUMNS)) + field(PIXEL_PATTERN_DN12)
        self._pattern_left = self._pattern * np.float32(PATTERN_LEFT)
        # Not in the outer columns, whose pixels have only one neighbour for the correction.
        places = generator.choice(ROWS * (COLUMNS - 2), FACTORY_DEAD + FACTORY_HOT, replace=False)
        rows, columns = np.divmod(places, COLUMNS - 2)
        places = rows * COLUMNS + columns + 1
        self._defects = np.sort(places)
        self._gain.ravel()[places[:FACTORY_DEAD]] = 0
        self._hot = places[FACTORY_DEAD:]
        self._hot_share = generator.exponential(size=FACTORY_HOT).astype(np.float32)
        for array in vars(self).values():
            array.flags.writeable = False
        self._most = Most.of(self._gain, self._dark_share, self._pattern)
        self._most_left = Most.of(self._gain, self._dark_share, self._pattern_left)

    def electrons_per_count(self, settings: Corrections) -> float:
        del settings
        return ELECTRONS_PER_DN12 * DN12_PER_DN8

    def counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: Corrections,
        noise: FrameNoise | None,
    ) -> Grey:
        if settings.remap is Remap.UPPER_BITS:
            return super().counts(light, exposure_s, condition, settings, noise)
        shape = (light.shape[0], light.shape[1])
        model = self.pixels(shape, exposure_s, condition, settings, noise)
        return remapped(light, model, settings.remap)

    def pixels(
        self,
        shape: tuple[int, int],
        exposure_s: float,
        condition: SkyCondition,
        settings: Corrections,
        noise: FrameNoise | None,
    ) -> PixelModel:
        if noise is None:
            return IDEAL
        per_second = dark_dn12_per_second(condition.temperature_c)
        hot_per_second = HOT_DN12_PER_S_AT_20_C * (per_second / dark_dn12_per_second(20.0))
        dark = per_second * effects.dark_rise(condition.hazards) * exposure_s * ELECTRONS_PER_DN12
        # The sensor does not correct those of the condition.
        grown, share = hot_pixels(condition.seed, condition.hot_count, shape[0] * shape[1])
        hot = np.concatenate([self._hot, grown])
        order = np.argsort(hot, kind="stable")
        hot_charge = np.concatenate([self._hot_share, share])[order]
        hot_charge *= np.float32(hot_per_second * (exposure_s * ELECTRONS_PER_DN12))
        exposure = self.exposure(shape, exposure_s, condition, settings)
        return replace(
            IDEAL,
            response=self._gain,
            dark=dark,
            dark_share=self._dark_share,
            hot=hot[order],
            hot_charge=hot_charge,
            noise=noise,
            steady=READ_NOISE_ELECTRONS**2 + effects.variance(condition.hazards, exposure),
            pattern=self._pattern_left if settings.fixed_pattern else self._pattern,
            black=dark if settings.dark else 0.0,
            repaired=self._defects if settings.defects else NOWHERE,
            most=self._most_left if settings.fixed_pattern else self._most,
        )


@lru_cache(maxsize=2)
def imager_of(seed: int) -> Mlx75412Imager:
    """The imager of part ``seed``, which sensors share: drawing its pattern is slow."""
    return Mlx75412Imager(seed)
