"""Noise of the MT9M001, from electrons in the pixels to eight bits.

AraMiS thesis, section 3.4: shot noise of the stars' light (equation 3.3), dark current (3.4),
background, quantisation (3.5, 3.6) and read-out noise (3.7), added as variances (3.8). Each term
can be switched off. MT9M001 data sheet, key performance: a signal to noise ratio of at most 45 dB
and a dynamic range of 68.2 dB, from which the full well (its square root is that ratio) and the
read-out noise follow. Values that neither publishes are marked as assumed.
"""

from dataclasses import dataclass

from cubestack.emulator.camera.common.dark import dark_at

FULL_WELL_ELECTRONS = 10 ** (45 / 10)
READ_NOISE_ELECTRONS = FULL_WELL_ELECTRONS / 10 ** (68.2 / 20)

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
