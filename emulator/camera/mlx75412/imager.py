"""Renders frames of the MLX75412: electrons to 8-bit counts, with noise and defects.

CubeStar thesis, section 3.4.4 (dark current and its subtraction), appendix C (upper 8 of 12 bits)
and appendix E: 2.28 electrons per count of 12 bits, dark signal of 1008 counts per second at 65 C.
Read noise, fixed pattern, defects and the dark signal's dependence on temperature are not
published; these constants are assumed, typical of automotive sensors of that time.

Shot, dark and read noise are drawn at once, as one normal distribution with the mean and the
variance of the sum, so that a frame needs one normal field. This neglects the skewness of the
Poisson part, which is at most 0.034 with this read noise.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.imager import Grey, Imager, Light
from cubestack.emulator.camera.common.view import SkyCondition
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


def dark_dn12_per_second(temperature_c: float) -> float:
    """Mean dark signal in counts of 12 bits per second."""
    return dark_at(DARK_DN12_PER_S_AT_65_C, temperature_c, 65.0)


def ideal_counts(electrons: Light) -> Grey:
    """Upper 8 of 12 bits for ``electrons`` without noise and defects."""
    return _upper_bits(electrons * np.float32(1 / ELECTRONS_PER_DN12))


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
        # Not in the outer columns, whose pixels have only one neighbour for the correction.
        places = generator.choice(ROWS * (COLUMNS - 2), FACTORY_DEAD + FACTORY_HOT, replace=False)
        rows, columns = np.divmod(places, COLUMNS - 2)
        self._defects = rows, columns + 1
        self._gain[rows[:FACTORY_DEAD], columns[:FACTORY_DEAD] + 1] = 0
        self._hot = rows[FACTORY_DEAD:], columns[FACTORY_DEAD:] + 1
        self._hot_share = generator.exponential(size=FACTORY_HOT).astype(np.float32)

    def electrons_per_count(self, settings: Corrections) -> float:
        del settings
        return ELECTRONS_PER_DN12 * DN12_PER_DN8

    def counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: Corrections,
        generator: np.random.Generator | None,
    ) -> Grey:
        if generator is None:
            return ideal_counts(light)
        per_second = dark_dn12_per_second(condition.temperature_c)
        hot_per_second = HOT_DN12_PER_S_AT_20_C * (per_second / dark_dn12_per_second(20.0))
        per_second *= effects.dark_rise(condition.hazards)
        dark_electrons = np.float32(per_second * exposure_s * ELECTRONS_PER_DN12)
        hot_electrons = np.float32(hot_per_second * (exposure_s * ELECTRONS_PER_DN12))
        mean = self._dark_share * dark_electrons
        mean += light * self._gain
        mean[self._hot] += self._hot_share * hot_electrons
        if condition.hot_count:
            # The sensor does not correct these.
            places, share = hot_pixels(condition.seed, condition.hot_count, light.size)
            mean.ravel()[places] += share * hot_electrons
        exposure = self.exposure((ROWS, COLUMNS), exposure_s, condition, settings)
        steady = READ_NOISE_ELECTRONS**2 + effects.variance(condition.hazards, exposure)
        signal = generator.standard_normal(mean.shape, np.float32)
        signal *= np.sqrt(mean + np.float32(steady))
        signal += mean
        signal *= np.float32(1 / ELECTRONS_PER_DN12)
        signal += self._pattern * np.float32(PATTERN_LEFT if settings.fixed_pattern else 1)
        if settings.dark:
            signal -= np.float32(per_second * exposure_s)
        if settings.defects:
            rows, columns = self._defects
            signal[rows, columns] = (signal[rows, columns - 1] + signal[rows, columns + 1]) / 2
        return _upper_bits(signal)


def _upper_bits(dn12: Light) -> Grey:
    """Round to whole counts of 12 bits, saturate, and take the upper 8 bits."""
    counts: Light = np.clip(dn12 + np.float32(0.5), 0, FULL_SCALE_DN12)
    counts *= np.float32(1 / DN12_PER_DN8)  # a power of two: exact, so truncation drops 4 bits
    return counts.astype(np.uint8, order="C")
