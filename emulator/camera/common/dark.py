"""Dark current by temperature, and the pixels that have much of it."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

DARK_DOUBLING_K = 8.0
"""Warming that doubles the dark current: assumed, what silicon usually does."""


def doubled(at_reference: float, temperature_c: float, reference_c: float) -> float:
    """A dark current or signal at ``temperature_c``, by what it is at ``reference_c``."""
    return float(at_reference * 2 ** ((temperature_c - reference_c) / DARK_DOUBLING_K))


@lru_cache(maxsize=8)
def hot_pixels(
    seed: int, count: int, pixels: int, mean: float = 1.0
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Flat indices among ``pixels`` of ``count`` that radiation has made hot, and how hot.

    The strengths are distributed exponentially.
    """
    generator = np.random.default_rng([seed, 0x407])
    places = generator.choice(pixels, count, replace=False)
    return places, (mean * generator.exponential(size=count)).astype(np.float32)
