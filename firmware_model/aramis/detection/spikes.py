"""Removing spikes of noise from the mask of bright pixels: both methods of the thesis.

AraMiS thesis, section 3.5, after Huffman. A star covers many neighbouring pixels, a spike few.
Method 1 steps a 5 x 5 window by one pixel and judges the pixel in its middle; method 2 steps it by
five and judges the bright pixels in it. Half of the window's pixels, 13 of 25, decide. A window
cut by the border is judged by the same part of the pixels that it has.

The text finds no significant difference between what the two remove. Of the time it says both that
method 1's was better and that method 2 is chosen for its lower cost; appendix E calls method 1, and
its comment has method 2 as the faster. Here method 2 is faster, and they do differ in what they
remove: method 2 loses stars that fall on the border of windows, none of which has half of its
pixels lit.

Method 1 runs as two sums, down the columns and along the rows of what they give: each step adds
the pixel that comes into the window and takes off the one that leaves it.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Mask
from cubestack.firmware_model.mcu.costs import Meter

WINDOW = 5
HALF = 13


class SpikeRemoval(IntEnum):
    """Which method is used."""

    OFF = 0
    CENTRE = 1
    WINDOW = 2


def remove_spikes(mask: Mask, method: SpikeRemoval, needed: int, meter: Meter) -> Mask:
    """Which of the bright pixels of a mask (rows, columns) are stars'; phase `spikes`.

    ``needed``: bright pixels that a window of 25 must have.
    """
    with meter.phase("spikes"):
        if method is SpikeRemoval.CENTRE:
            return _centre(mask, needed, meter)
        if method is SpikeRemoval.WINDOW:
            return _window(mask, needed, meter)
        return mask


def _centre(mask: Mask, needed: int, meter: Meter) -> Mask:
    rows, columns = mask.shape
    bright = _sliding(_sliding(mask.astype(np.uint8)).T).T
    present = np.outer(_present(rows), _present(columns))
    steps = 2 * mask.size
    meter.charge(table_byte=2 * steps, i32_add=2 * steps, loop=steps, ram_write=steps)
    meter.charge(i32_add=mask.size)
    return WINDOW**2 * bright.astype(np.int32) >= needed * present


def _window(mask: Mask, needed: int, meter: Meter) -> Mask:
    rows, columns = mask.shape
    tops, lefts = np.arange(0, rows, WINDOW), np.arange(0, columns, WINDOW)
    bright = np.add.reduceat(np.add.reduceat(mask, tops, axis=0, dtype=np.int32), lefts, axis=1)
    heights, widths = np.diff(np.append(tops, rows)), np.diff(np.append(lefts, columns))
    enough = WINDOW**2 * bright >= needed * np.outer(heights, widths)
    steps = mask.size + enough.size
    meter.charge(table_byte=mask.size, i32_add=steps, loop=steps)
    meter.charge(ram_write=int((~enough & (bright > 0)).sum()) * WINDOW**2)
    return mask & np.repeat(np.repeat(enough, heights, axis=0), widths, axis=1)


def _sliding(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Sum of each element and the two before and after it in its column, 0 beyond the ends."""
    total = values.copy()
    for step in range(1, WINDOW // 2 + 1):
        total[step:] += values[:-step]
        total[:-step] += values[step:]
    return total


def _present(count: int) -> NDArray[np.int32]:
    """Lines of a window around each of so many lines that are in the picture."""
    place, half = np.arange(count), WINDOW // 2
    lines: NDArray[np.int32] = np.minimum(place, half) + np.minimum(count - 1 - place, half) + 1
    return lines.astype(np.int32)
