"""The sky behind the stars: its level and noise in cells, interpolated between them.

Of each cell of 32 x 32 px, every few pixels of every few rows are samples. The level is the mean of
their middle half, which no star and no hot pixel reaches; the noise comes from the smaller three
quarters of the differences between neighbouring samples of a row, which no gradient reaches. Both
are found by counting in a histogram and are kept in 1/16 DN. Between the cells' middles they are
interpolated, beyond the outer ones continued on a straight line.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.inner_loops import BYTES, FLOAT, INT, INTS, MARKS, Loop

CELL = 32  #: width of a cell in px
UNIT = 16  #: parts of a DN that levels are kept in
BLOCK = 8  #: pixels of a row that share a threshold

#: In 1/16 DN: what rounding to whole DN leaves of a sky without noise, 1 / sqrt(12) DN.
LEAST_NOISE = 5

#: Mean of |x - y| below its upper quartile, in standard deviations of x and y.
_QUARTILE_MEAN = 0.728

Ints = NDArray[np.int64]
Marks = NDArray[np.bool_]

_BRIGHTER = Loop("sky_brighter", BYTES, INT, INT, INTS, INTS, INT, INT, FLOAT, INT, MARKS)
_ESTIMATE = Loop("sky_estimate", BYTES, INT, INT, INT, INTS, INTS, INTS)


@dataclass(frozen=True, eq=False)
class SkyBackground:
    """Levels and noises (cells down, cells across) in 1/16 DN; at least two cells each way."""

    levels: Ints
    noises: Ints
    saturated: float = 0.0  #: share of the samples at the end of the scale, 0 to 1
    #: values that the histograms counted
    samples: int = 0
    differences: int = 0
    bins: int = 0  #: bins that were added up to the quartiles

    def interpolated(self, cells: Ints, rows: Ints, columns: Ints) -> Ints:
        """Values of ``cells`` at rows and columns, broadcast."""
        top, down = _between(rows, cells.shape[0])
        left, across = _between(columns, cells.shape[1])
        upper = cells[top, left] * (CELL - across) + cells[top, left + 1] * across
        lower = cells[top + 1, left] * (CELL - across) + cells[top + 1, left + 1] * across
        value: Ints = np.asarray(upper * (CELL - down) + lower * down, np.int64)
        return value // (CELL * CELL)

    def brighter(self, picture: NDArray[np.uint8], sigmas: float, least: int = 0) -> Marks:
        """Which pixels (rows, columns) exceed the level by ``sigmas`` of the noise and by ``least``
        1/16 DN."""
        height, width = picture.shape
        if _BRIGHTER:
            found = np.empty((height, width), np.bool_)
            cells = (self.levels, self.noises, *self.levels.shape)
            _BRIGHTER(np.ascontiguousarray(picture), *picture.shape, *cells, sigmas, least, found)
            return found
        y, x = np.arange(height)[:, None], np.arange(BLOCK // 2, width + BLOCK, BLOCK)[None, :]
        above = np.maximum(sigmas * self.interpolated(self.noises, y, x), least)
        levels = (self.interpolated(self.levels, y, x) + above) // UNIT
        thresholds = np.repeat(np.clip(levels, 0, 255).astype(np.uint8), BLOCK, axis=1)
        bright: Marks = picture > thresholds[:, :width]
        return bright

    def smoothed(self) -> Self:
        """Each cell replaced by the median of it and its eight neighbours, which removes spots that
        fill a cell."""
        return replace(self, levels=_medians(self.levels), noises=_medians(self.noises))


def _between(places: Ints, count: int) -> tuple[Ints, Ints]:
    """The cell before each place, and the distance of the place from its middle in px."""
    before = np.clip((places - CELL // 2) // CELL, 0, count - 2)
    return before, places - CELL // 2 - before * CELL


def _medians(cells: Ints) -> Ints:
    padded = np.pad(cells, 1, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray(np.median(around, axis=(2, 3)), np.int64)


def cell_middles(size: int) -> Ints:
    """Places of the cells' middles along a side of a picture, none outside of it."""
    return np.minimum(np.arange(max(2, -(-size // CELL))) * CELL + CELL // 2, size - 1)


def sample_offsets(rows: int, columns: int, step: int) -> tuple[Ints, Ints]:
    """Rows and columns of the samples in a region, ``step`` px apart. A cell that reaches beyond
    the region repeats its last ones."""
    across = CELL // step
    down, along = (
        np.minimum(step // 2 + step * np.arange(across * max(2, -(-size // CELL))), size - 1)
        for size in (rows, columns)
    )
    return down, along


def estimate(
    samples: NDArray[np.uint8], step: int, least_noise: float = LEAST_NOISE
) -> SkyBackground:
    """The background, of samples (rows, columns) at the places of ``sample_offsets``;
    ``least_noise`` in 1/16 DN."""
    side = CELL // step
    count, pairs = side * side, side * (side - 1)
    down, across = (size // side for size in samples.shape)
    to_sigma = round(256 * UNIT / (3 * pairs // 4 * _QUARTILE_MEAN))
    if _ESTIMATE:
        (middle, smaller), totals = np.empty((2, down, across), np.int64), np.empty(2, np.int64)
        _ESTIMATE(np.ascontiguousarray(samples), down, across, side, middle, smaller, totals)
        bins, share = int(totals[0]), int(totals[1]) / samples.size
    else:
        middle, smaller, bins, share = _sums(samples, side)
    return SkyBackground(
        middle * UNIT // (count // 2),
        np.maximum(smaller * to_sigma >> 8, round(least_noise)),
        share,
        samples.size,
        down * across * pairs,
        bins,
    )


def _sums(samples: NDArray[np.uint8], side: int) -> tuple[Ints, Ints, int, float]:
    """Sums (cells down, cells across) of the middle half of the samples and of the smaller
    differences; the bins added up; the share of samples at the end of the scale."""
    count, pairs = side * side, side * (side - 1)
    down, across = (size // side for size in samples.shape)
    cells = samples.reshape(down, side, across, side).transpose(0, 2, 1, 3).astype(np.int16)
    values = np.sort(cells.reshape(down, across, count))
    differences = np.sort(np.abs(np.diff(cells)).reshape(down, across, pairs))
    middle = values[..., count // 4 : 3 * count // 4].sum(axis=-1, dtype=np.int64)
    smaller = differences[..., : 3 * pairs // 4].sum(axis=-1, dtype=np.int64)
    bins = int(values[..., 3 * count // 4].sum() - values[..., 0].sum())
    bins += int(differences[..., 3 * pairs // 4].sum()) + 2 * down * across
    return middle, smaller, bins, float(np.mean(values == 255))
