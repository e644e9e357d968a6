"""Cost of the search above the background: the part's operations for each thing done."""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.spots import SIDE
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.background import BLOCK, CELL, SkyBackground

Operations = dict[str, int]

#: Of a bright pixel of a short run: is it sharper than a spot?
TEST: Operations = {"ram_read": 5, "i32_add": 10, "loop": 1}

#: Of one that is not: its part in the sums of its area.
PIXEL: Operations = {"ram_read": 3, "i32_add": 12, "i32_mul": 4}

#: Of a run: the runs that it touches, and its area.
RUN: Operations = {"ram_read": 20, "ram_write": 12, "i32_add": 18, "loop": 4}

#: Of an area that is not too small: its moments, and its place in the list.
AREA: Operations = {
    **{"ram_read": 14, "ram_write": 8, "i32_add": 40, "i32_mul": 8},
    **{"i32_div": 5, "loop": 2},
}

#: Of a pixel on a slope, beside its row: what is no brighter than both needs no sum. In place of
#: the comparison with the cells' level.
SLOPE_PIXEL: Operations = {"ram_read": 2, "i32_add": 1}

BUMP: Operations = {"i32_add": 15, "loop": 3}  #: of one that is brighter, in the other directions

#: Words of a cell's histogram of bytes that are cleared, for levels and for differences.
CELLS_READ = 64


def charge_each(count: int, operations: Operations, meter: Meter) -> None:
    """Charge the operations of one thing ``count`` times."""
    meter.charge(**{name: count * times for name, times in operations.items()})


def charge_background(sky: SkyBackground, meter: Meter) -> None:
    """Histograms of bytes: cleared by words, filled, and added up as far as the quartile."""
    filled, cells = sky.samples + sky.differences, sky.levels.size
    steps = filled + sky.bins
    meter.charge(ram_write=2 * CELLS_READ * cells + filled, ram_read=steps, loop=steps)
    meter.charge(i32_add=3 * steps, i32_mul=sky.bins, i32_div=2 * cells)


def charge_thresholds(height: int, width: int, meter: Meter) -> None:
    """A comparison and a branch per pixel; the threshold changes with each block, and its step is
    calculated for each row of a cell."""
    blocks, steps = height * -(-(width + BLOCK // 2) // BLOCK), height * max(2, -(-width // CELL))
    meter.charge(i32_add=2 * height * width + 6 * blocks + 12 * steps, loop=blocks + steps)
    meter.charge(ram_read=4 * steps, i32_mul=4 * steps)


def rows_in_time(
    rows_of: tuple[tuple[NDArray[np.int64], Operations, float], ...],
    height: int,
    cycles: int,
    meter: Meter,
) -> int:
    """Number of rows that ``cycles`` suffice for; ``rows_of``: rows of things, operations of one,
    and their share."""
    spent = np.zeros(height)
    for rows, operations, share in rows_of:
        each = sum(meter.table.operations[name].cycles * n for name, n in operations.items())
        spent += each * np.bincount(rows, minlength=height) * share
    return int(np.searchsorted(np.cumsum(spent), cycles, "right"))


def charge_windows_read(count: int, meter: Meter) -> None:
    """The signal of each window's pixels, above the level there."""
    pixels = count * SIDE * SIDE
    meter.charge(i32_add=4 * pixels, i32_mul=2 * pixels, loop=pixels)


def charge_rounds(windows: int, rounds: int, meter: Meter) -> None:
    """Sums of windows: a weight, a comparison and three products for each pixel."""
    pixels = rounds * windows * SIDE * SIDE
    meter.charge(ram_read=3 * pixels, i32_mul=4 * pixels, i32_add=5 * pixels, loop=pixels)
    meter.charge(i32_div=4 * rounds * windows)


def charge_centroids(count: int, meter: Meter) -> None:
    """The last division and the expected error of each centroid, in floating point."""
    meter.charge(f32_convert=6 * count, f32_div=6 * count, f32_add=6 * count, f32_sqrt=count)
    meter.charge(f32_mul=6 * count)
