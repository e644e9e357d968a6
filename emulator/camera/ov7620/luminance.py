"""Converts light on the OV7620's pixels to its 8-bit Y output, with noise and stuck pixels.

CubeSense thesis, section 5.7 (a dark image has the mean level 34), section 6.6.1 (pixels that are
stuck above a threshold) and appendix A.1 (signal to noise ratio above 48 dB). The split of the
noise into a constant part and one that grows with the light is assumed; their sum is 48 dB at full
scale and gain 1. Dark current and fixed pattern are neglected: at these exposures and 8 bits they
are below a tenth of a grey value.
"""

from functools import lru_cache

import numpy as np

from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import Grey, Light, PixelModel, Places, grey_values
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, ROWS

BLACK = 34
"""Level without light (published, for both cameras)."""

FULL_SCALE = 255
F_NUMBER = 2.8  # published, section 3.2
PITCH_UM = 7.6  # published
SPOT_PX = 0.6
"""Standard deviation of a point's image in focus: assumed, like that of the Moon in `light`."""

READ_NOISE = 0.7  # grey values (assumed)
SHOT_NOISE = (1 - READ_NOISE**2) / (FULL_SCALE - BLACK)
"""Variance per grey value of light: results in one grey value of noise, 48 dB, at full scale."""

ELECTRONS_PER_GREY = 1 / SHOT_NOISE
"""At gain 1, from the shot noise by Poisson's law."""


def luminance(
    light: Light, gain: float, noise: FrameNoise | None, stuck: Places, variance: float = 0.0
) -> Grey:
    """Grey values (480, 640) of ``light``, of the same shape.

    Args:
        light: grey values above black at gain 1, unlimited.
        gain: amplification.
        noise: of this frame; None for an ideal sensor.
        stuck: flat indices of pixels at full scale.
        variance: variance of additional noise, grey values squared at gain 1.
    """
    steady = READ_NOISE**2 + variance
    model = PixelModel(
        noise=noise, shot=SHOT_NOISE, steady=steady, gain=gain, offset=BLACK, stuck=stuck
    )
    return grey_values(light, model)


@lru_cache(maxsize=8)
def stuck_pixels(seed: int, camera: int, singles: int, pairs: int) -> Places:
    """Flat indices of ``singles`` stuck pixels and ``pairs`` of adjacent ones in a row.

    They differ per ``camera`` number.
    """
    generator = np.random.default_rng([seed, camera, 0x407])
    # Slots of four columns, so that no two of them form a run of three.
    slots = 4 * generator.choice(ROWS * COLUMNS // 4, singles + pairs, replace=False)
    first = slots + generator.integers(0, 2, len(slots))
    stuck: Places = np.concatenate([first, first[:pairs] + 1])
    stuck.flags.writeable = False
    return stuck
