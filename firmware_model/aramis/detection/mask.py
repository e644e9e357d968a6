"""The mask of bright pixels as the thesis makes it: its threshold, and the removal of spikes.

AraMiS thesis, section 3.5. The threshold is the mean grey level of the last five pictures plus
twice the noise. The noise is the standard deviation over the same pixels (the thesis does not
define it); stars cover too few pixels to matter.

A star covers many neighbouring pixels, a spike few (after Huffman). Method 1 moves a 5 x 5 window
by one pixel and judges the pixel in its middle; method 2 moves it by five and judges the bright
pixels in it. Half of the window's pixels, 13 of 25, decide. A window at the border is judged by the
same share of the pixels that it has.

The text finds no significant difference between the results. It says that method 1 was faster, and
that method 2 is chosen for its lower cost; appendix E calls method 1, with method 2 as the faster
in its comment. Here method 2 is faster, and the results differ: method 2 loses stars on the border
of windows, none of which has half of its pixels lit.
"""

from collections import deque
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Mask
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import BYTES, INT, INTS, MARKS, Loop

FRAMES = 5

WINDOW = 5
HALF = 13

_LEVELS = Loop("mask_levels", BYTES, MARKS, INT, INTS)
_CENTRE = Loop("mask_centre", MARKS, INT, INT, INT, MARKS)
_WINDOW = Loop("mask_window", MARKS, INT, INT, INT, MARKS)


class LevelHistory:
    """Grey levels of the last pictures; what the program keeps from one picture to the next.

    Attributes:
        sums: (pixels, sum, sum of squares) of each picture, the newest last. The Blackfin's 40-bit
            accumulator holds the squares of 1280 x 1024 pixels.
    """

    def __init__(self) -> None:
        self.sums: deque[tuple[int, int, int]] = deque(maxlen=FRAMES)

    def add(self, picture: NDArray[np.uint8], field: CameraField, meter: Meter) -> None:
        """Count a picture (rows, columns), without the pixels outside the field."""
        levels = _levels(picture, field.mask)
        values, pixels = np.arange(256), field.pixels
        self.sums.append((pixels, int(levels @ values), int(levels @ values**2)))
        meter.charge(pixel_read=pixels, i32_add=2 * pixels, i32_mul=pixels, loop=pixels)

    def mean(self, meter: Meter) -> int:
        """Mean level, rounded; 0 without a picture."""
        pixels, total, _ = self._totals()
        meter.charge(i32_add=FRAMES, i32_div=1)
        return (total + pixels // 2) // pixels if pixels else 0

    def threshold(self, sigmas: float, meter: Meter) -> int:
        """Level above which a pixel is a star's: mean plus ``sigmas`` standard deviations."""
        pixels, total, squares = self._totals()
        # The two products have 62 bits, of four 32-bit ones each.
        meter.charge(i32_add=3 * FRAMES + 8, i32_mul=8, f32_convert=3, f32_div=2, f32_sqrt=1)
        meter.charge(f32_mul=1, f32_add=1, loop=FRAMES)
        if not pixels:
            return 0
        count = np.float32(pixels)
        deviation = np.sqrt(np.float32(squares * pixels - total * total)) / count
        return int(np.float32(total) / count + np.float32(sigmas) * deviation)

    def _totals(self) -> tuple[int, int, int]:
        pixels, total, squares = map(sum, zip(*self.sums, (0, 0, 0), strict=True))
        return pixels, total, squares


def _levels(picture: NDArray[np.uint8], inside: Mask) -> NDArray[np.int64]:
    """Number of pixels of each level (256,)."""
    if _LEVELS:
        levels = np.empty(256, np.int64)
        _LEVELS(np.ascontiguousarray(picture), inside, picture.size, levels)
        return levels
    return np.bincount(picture[inside], minlength=256).astype(np.int64)


class SpikeRemoval(IntEnum):
    """Which method is used."""

    OFF = 0
    CENTRE = 1
    WINDOW = 2


def remove_spikes(mask: Mask, method: SpikeRemoval, needed: int) -> tuple[Mask, int]:
    """Which of the bright pixels of a mask (rows, columns) are stars', and the number of windows
    that were cleared; ``needed``: bright pixels that a window of 25 must have."""
    compiled = {SpikeRemoval.CENTRE: _CENTRE, SpikeRemoval.WINDOW: _WINDOW}.get(method)
    if compiled:
        stars = np.empty(mask.shape, np.bool_)
        return stars, compiled(np.ascontiguousarray(mask), *mask.shape, needed, stars)
    if method is SpikeRemoval.CENTRE:
        return _centre(mask, needed), 0
    if method is SpikeRemoval.WINDOW:
        return _window(mask, needed)
    return mask, 0


def _centre(mask: Mask, needed: int) -> Mask:
    """Method 1, as two running sums: down the columns and along their rows."""
    bright = _sliding(_sliding(mask.astype(np.uint8)).T).T
    present = np.outer(*(_sliding(np.ones(size, np.int32)) for size in mask.shape))
    return WINDOW**2 * bright.astype(np.int32) >= needed * present


def _window(mask: Mask, needed: int) -> tuple[Mask, int]:
    rows, columns = mask.shape
    tops, lefts = np.arange(0, rows, WINDOW), np.arange(0, columns, WINDOW)
    bright = np.add.reduceat(np.add.reduceat(mask, tops, axis=0, dtype=np.int32), lefts, axis=1)
    heights, widths = np.diff(np.append(tops, rows)), np.diff(np.append(lefts, columns))
    enough = WINDOW**2 * bright >= needed * np.outer(heights, widths)
    cleared = int((~enough & (bright > 0)).sum())
    return mask & np.repeat(np.repeat(enough, heights, axis=0), widths, axis=1), cleared


def _sliding(values: NDArray[Any]) -> NDArray[Any]:
    """Sum of each element and the two before and after it in its column, 0 beyond the ends."""
    total = values.copy()
    for step in range(1, WINDOW // 2 + 1):
        total[step:] += values[:-step]
        total[:-step] += values[step:]
    return total
