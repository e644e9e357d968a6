"""Dark current by temperature, and hot pixels."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

DARK_DOUBLING_K = 8.0
"""Temperature rise that doubles the dark current: assumed, typical of silicon."""


def dark_at(at_reference: float, temperature_c: float, reference_c: float) -> float:
    """A dark current or signal at ``temperature_c``, from its value at ``reference_c``."""
    return float(at_reference * 2 ** ((temperature_c - reference_c) / DARK_DOUBLING_K))


@lru_cache(maxsize=8)
def hot_pixels(
    seed: int, count: int, pixels: int, mean: float = 1.0
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Flat indices of ``count`` hot pixels among ``pixels``, and their exponential strengths."""
    generator = np.random.default_rng([seed, 0x407])
    places = generator.choice(pixels, count, replace=False)
    return places, (mean * generator.exponential(size=count)).astype(np.float32)
