"""Grey values stretched for the eye; files of raw values are written beside, unstretched."""

import numpy as np
from numpy.typing import NDArray

FEWEST_COUNTS = 24
"""Range of grey values that is stretched to the whole, at least: noise is not made a picture."""

DARKEST, BRIGHTEST = 1.0, 99.98
"""Percentiles that become black and white: hot or dead pixels alone do not set the scale."""

SKY = 50.0
"""The same of black where at least half of a picture is dark sky."""

GAMMA = 0.6


def stretched(
    picture: NDArray[np.uint8], darkest: float = DARKEST, gamma: float = GAMMA
) -> NDArray[np.uint8]:
    """``picture`` between two of its percentiles, with a gamma.

    Args:
        picture: grey values (rows, columns).
        darkest: percentile, 0 to 100, at and below which it becomes black.
        gamma: exponent; below 1 it lifts what is faint.
    """
    low, high = np.percentile(picture, (darkest, BRIGHTEST))
    spread = max(float(high - low), FEWEST_COUNTS)
    grey = 255 * np.clip((picture - low) / spread, 0, 1) ** gamma
    return np.asarray(grey, np.uint8)
