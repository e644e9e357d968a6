"""From 12 bits to 8 by a frame's histogram, in two ways: the sensor's own is not published.

CubeStar thesis, appendix D: the remap gives more of the 8 bits to those areas of the histogram that
contain more information, and AutoView computes its constants. Assumed: from the frame itself, where
the sensor would take the one before.
"""

from dataclasses import replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.pixels import Grey, Light, PixelModel, grey_values

DEPTH = 4096
_LOW = 255  # values below it are exact, others to a step of the upper 8 bits


class Remap(Enum):
    """The 8 bits of a pixel."""

    UPPER_BITS = "upper-bits"  #: no remap
    STRETCHED = "stretched"  #: the range of the frame's values is mapped to 0 to 255
    EQUALIZED = "equalized"  #: each grey value gets as many pixels, as far as values differ


def remapped(light: Light, model: PixelModel, remap: Remap) -> Grey:
    """Grey values (rows, columns) of ``light``; ``model`` yields the upper 8 bits."""
    coarse = grey_values(light, model).astype(np.uint16)
    fine = grey_values(light, replace(model, full_scale=_LOW, step=1.0))
    step = np.uint16(round(1 / model.step))
    values = np.where(fine < _LOW, fine, np.maximum(coarse * step + step // 2, np.uint16(_LOW)))
    return table(np.bincount(values.ravel(), minlength=DEPTH), remap)[values]


def table(histogram: NDArray[np.int64], remap: Remap) -> Grey:
    """Grey value (4096,) of each value, not decreasing; of the number of pixels (4096,) of each."""
    values, occupied = np.arange(DEPTH), np.flatnonzero(histogram)
    if remap is Remap.UPPER_BITS:
        return (values // (DEPTH // 256)).astype(np.uint8)
    low, high = int(occupied[0]), int(occupied[-1])
    if remap is Remap.STRETCHED:
        share = (values - low) / max(high - low, 1)
    else:
        below = np.cumsum(histogram) - histogram
        share = (below - below[low]) / max(int(below[high] - below[low]), 1)
    return np.floor(255 * np.clip(share, 0, 1)).astype(np.uint8)
