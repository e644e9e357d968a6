"""From electrons in the MT9M001's pixels to the eight bits on its wires, with the noise in between.

AraMiS thesis, section 3.4: shot noise of the stars' light (equation 3.3), dark current (3.4),
background, quantisation (3.5, 3.6) and read-out noise (3.7), added up as variances (3.8). Each can
be switched off. MT9M001 data sheet, key performance: a signal to noise ratio of 45 dB at best and a
dynamic range of 68.2 dB, which give the full well (its square root is that ratio) and the read-out
noise. What is published neither here nor there is marked as assumed.

Shot, dark, background and read-out noise are drawn at once, as one normal distribution with the
mean and the variance of all of them together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.imager import Grey, Light, doubled

__all__ = [
    "FULL_SCALE",
    "FULL_WELL_ELECTRONS",
    "READ_NOISE_ELECTRONS",
    "NoiseTerms",
    "Surroundings",
    "counts",
    "dark_electrons_per_s",
    "quantisation_sigma",
]

FULL_WELL_ELECTRONS = 10 ** (45 / 10)
READ_NOISE_ELECTRONS = FULL_WELL_ELECTRONS / 10 ** (68.2 / 20)

FULL_SCALE = 1023
"""Of the converter, 10 bits; the upper 8 are wired."""

BLACK_LEVEL = 6
"""In counts of 10 bits: between thresholds 4 and 9 of the sensor's own calibration (assumed)."""

DARK_ELECTRONS_PER_S_AT_25_C = 50.0  # assumed
HOT_SHARE = 500.0  # assumed: mean dark current of a hot pixel, in units of the usual one


@dataclass(frozen=True)
class NoiseTerms:
    """Which terms of equation 3.8 are on.

    Attributes:
        shot: of the stars' light.
        dark: dark current, hot pixels and their noise.
        background: light from elsewhere, and its noise.
        quantisation: the converter's 10 bits, of which 8 are wired; off, the nearest of 256 counts,
            which is the least error that eight wires allow.
        readout: of the amplifiers.
    """

    shot: bool = True
    dark: bool = True
    background: bool = True
    quantisation: bool = True
    readout: bool = True

    @classmethod
    def none(cls) -> "NoiseTerms":
        """All of them off."""
        return cls(shot=False, dark=False, background=False, quantisation=False, readout=False)


@dataclass(frozen=True)
class Surroundings:
    """What adds electrons beside the stars.

    Attributes:
        temperature_c: of the sensor.
        background_electrons_per_s: in each pixel; the default is a dark sky of 22 mag/arcsec2 and
            as much stray light (assumed).
    """

    temperature_c: float = 20.0
    background_electrons_per_s: float = 15.0


def dark_electrons_per_s(temperature_c: float) -> float:
    """Mean dark current of a pixel."""
    return doubled(DARK_ELECTRONS_PER_S_AT_25_C, temperature_c, 25.0)


def quantisation_sigma(gain: float, bits: int = 10) -> float:
    """Standard deviation of the quantisation in electrons, equations 3.5 and 3.6."""
    return float(FULL_WELL_ELECTRONS / gain / 2**bits / np.sqrt(12))


def counts(
    light: Light,
    exposure_s: float,
    gain: float | Light,
    surroundings: Surroundings,
    terms: NoiseTerms,
    generator: np.random.Generator | None,
    hot: tuple[NDArray[np.int64], Light] | None = None,
) -> Grey:
    """One frame, same shape as ``light``, C-contiguous.

    Args:
        light: mean number of electrons that starlight frees in each pixel.
        exposure_s: exposure of each pixel.
        gain: amplification, one for all or one for each pixel.
        surroundings: dark current and background.
        terms: which kinds of noise there are.
        generator: source of this frame's noise; None when ``terms`` has none.
        hot: flat indices and multiples of hot pixels.
    """
    surplus = 0.0
    if terms.background:
        surplus += surroundings.background_electrons_per_s * exposure_s
    dark = dark_electrons_per_s(surroundings.temperature_c) * exposure_s
    if terms.dark:
        surplus += dark
    mean = light + np.float32(surplus)
    if terms.dark and hot is not None:
        mean.ravel()[hot[0]] += hot[1] * np.float32(dark)
    steady = READ_NOISE_ELECTRONS**2 if terms.readout else 0.0
    noisy = mean if terms.shot else mean - light
    variance = noisy + np.float32(steady)
    signal = mean
    if generator is not None and (terms.shot or surplus or steady):
        noise = generator.standard_normal(light.shape, np.float32)
        noise *= np.sqrt(variance)
        signal += noise
    # The dark rows' mean, which holds the mean dark current, is subtracted on the chip.
    if terms.dark:
        signal -= np.float32(dark)
    signal *= gain * np.float32((FULL_SCALE + 1) / FULL_WELL_ELECTRONS)
    signal += np.float32(BLACK_LEVEL)
    if not terms.quantisation:
        nearest: Light = np.clip(signal / np.float32(4) + np.float32(0.5), 0, FULL_SCALE // 4)
        return nearest.astype(np.uint8)
    whole: Light = np.clip(signal + np.float32(0.5), 0, FULL_SCALE)
    return (whole.astype(np.uint16) >> 2).astype(np.uint8)
