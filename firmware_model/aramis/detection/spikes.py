"""Removal of noise spikes from the mask of bright pixels: both methods of the thesis.

AraMiS thesis, section 3.5, after Huffman. A star covers many neighbouring pixels, a spike few.
Method 1 moves a 5 x 5 window by one pixel and judges the pixel in its middle; method 2 moves it by
five and judges the bright pixels in it. Half of the window's pixels, 13 of 25, decide. A window at
the border is judged by the same share of the pixels that it has.

The text finds no significant difference between the results. It says that method 1 was faster, and
that method 2 is chosen for its lower cost; appendix E calls method 1, with method 2 as the faster
in its comment. Here method 2 is faster, and the results differ: method 2 loses stars on the border
of windows, none of which has half of its pixels lit.

Method 1 runs as two running sums, down the columns and along their rows.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Mask

WINDOW = 5
HALF = 13


class SpikeRemoval(IntEnum):
    """Which method is used."""

    OFF = 0
    CENTRE = 1
    WINDOW = 2


def remove_spikes(mask: Mask, method: SpikeRemoval, needed: int) -> tuple[Mask, int]:
    """Which of the bright pixels of a mask (rows, columns) are stars', and the number of windows
    that were cleared; ``needed``: bright pixels that a window of 25 must have."""
    if method is SpikeRemoval.CENTRE:
        return _centre(mask, needed), 0
    if method is SpikeRemoval.WINDOW:
        return _window(mask, needed)
    return mask, 0


def _centre(mask: Mask, needed: int) -> Mask:
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
