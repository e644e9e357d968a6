"""The sky behind the stars: its level and noise in cells, interpolated between them.

Each cell of 32 x 32 px has 64 samples, every fourth pixel of every fourth row. The level is the
mean of their middle half, which no star and no hot pixel reaches; the noise comes from the smaller
three quarters of the differences between neighbouring samples of a row, which no gradient reaches.
Both are found by counting in a histogram and are kept in 1/16 DN. Between the cells' middles they
are interpolated, beyond the outer ones continued on a straight line.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

CELL = 32
STEP = 4
"""Width of a cell, and distance of its samples, in px."""

UNIT = 16
"""Parts of a DN that levels are kept in."""

LEAST_NOISE = 5
"""In 1/16 DN: what rounding to whole DN leaves of a sky without noise, 1 / sqrt(12) DN."""

_ACROSS = CELL // STEP
_SAMPLES = _ACROSS * _ACROSS
_PAIRS = _ACROSS * (_ACROSS - 1)
_NOISE_SHARE = 134
"""Over 256: 16 times the sum of the 42 smallest of 56 differences, divided by 42 and by 0.728, the
mean of |x - y| below its upper quartile, in standard deviations of x and y."""

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Background:
    """Levels and noises (cells down, cells across) in 1/16 DN; at least two cells each way."""

    levels: Ints
    noises: Ints
    saturated: float
    """Share of the samples at the end of the scale, 0 to 1."""

    def interpolated(self, cells: Ints, rows: Ints, columns: Ints) -> Ints:
        """Values of ``cells`` at places that are given by row and column, broadcast."""
        top, down = _between(rows, cells.shape[0])
        left, across = _between(columns, cells.shape[1])
        upper = cells[top, left] * (CELL - across) + cells[top, left + 1] * across
        lower = cells[top + 1, left] * (CELL - across) + cells[top + 1, left + 1] * across
        value: Ints = np.asarray(upper * (CELL - down) + lower * down, np.int64)
        return value // (CELL * CELL)


def _between(places: Ints, count: int) -> tuple[Ints, Ints]:
    """The cell before each place, and how far behind its middle the place is, in px."""
    before = np.clip((places - CELL // 2) // CELL, 0, count - 2)
    return before, places - CELL // 2 - before * CELL


def sample_offsets(rows: int, columns: int) -> tuple[Ints, Ints]:
    """Rows and columns of the samples in a region of such a size.

    A cell that reaches beyond the region repeats its last ones.
    """
    down, across = (
        np.minimum(STEP // 2 + STEP * np.arange(_ACROSS * max(2, -(-size // CELL))), size - 1)
        for size in (rows, columns)
    )
    return down, across


def estimate(samples: NDArray[np.uint8], meter: Meter) -> Background:
    """The background, of samples (rows, columns) at the places of ``sample_offsets``."""
    down, across = (size // _ACROSS for size in samples.shape)
    cells = samples.reshape(down, _ACROSS, across, _ACROSS).transpose(0, 2, 1, 3).astype(np.int16)
    values = np.sort(cells.reshape(down, across, _SAMPLES))
    differences = np.sort(np.abs(np.diff(cells)).reshape(down, across, _PAIRS))
    middle = values[..., _SAMPLES // 4 : 3 * _SAMPLES // 4].sum(axis=-1, dtype=np.int64)
    smaller = differences[..., : 3 * _PAIRS // 4].sum(axis=-1, dtype=np.int64)
    # Histograms of bytes: cleared by words, filled, and added up as far as the quartile.
    looked_at = int(values[..., 3 * _SAMPLES // 4].sum() - values[..., 0].sum())
    looked_at += (
        int(differences[..., 3 * _PAIRS // 4].sum()) + 2 * values.shape[0] * values.shape[1]
    )
    filled = samples.size + differences.size
    cleared = 2 * 64 * down * across
    meter.charge(ram_write=cleared + filled, ram_read=filled + looked_at, loop=filled + looked_at)
    meter.charge(i32_add=3 * filled + 3 * looked_at, i32_mul=looked_at, i32_div=2 * down * across)
    return Background(
        middle * UNIT // (_SAMPLES // 2),
        np.maximum(smaller * _NOISE_SHARE >> 8, LEAST_NOISE),
        float(np.mean(values == 255)),
    )
