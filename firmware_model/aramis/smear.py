"""How far the stars were drawn out while the picture was taken. Ours: the thesis has none.

A star that moves during the exposure leaves a streak. Its second moments along and across differ by
the square of the streak's length over twelve, as those of a line do, whatever the star's own width.
A long streak of a faint star is lost among the noise of single pixels, but not of blocks of them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.regions import Regions, find_regions
from cubestack.firmware_model.costs import Meter

__all__ = ["DRAWN_OUT_PX", "smear_px", "streak_px"]

LARGEST = 10
"""Regions looked at."""

UPPER_QUARTILE = 75
"""Of the lengths: long streaks fall apart, and their pieces are shorter."""

DRAWN_OUT_PX = 2.5
"""Stars that do not move seldom look so long."""

BLOCK = 8
"""Pixels along a side of a block."""

BLOCK_SIGMAS = 4.0
SHORTEST_PX = 40.0
"""Of a streak among blocks; a group of stars that do not move may look half as long."""

ALIKE = 0.4
"""Of the longest, to agree with it."""

QUARTILES_APART = 1.349
"""Between the quartiles of a normal distribution, in standard deviations."""


def smear_px(picture: NDArray[np.uint8], regions: Regions, floor: int, meter: Meter) -> float:
    """Upper quartile of the lengths of the largest regions, weighed by grey levels above `floor`.

    0 without regions.
    """
    grey = picture[regions.rows, regions.columns].astype(np.float32)
    lengths = _lengths(regions, np.maximum(grey - np.float32(floor), 1), meter)
    return float(np.percentile(lengths, UPPER_QUARTILE)) if lengths else 0.0


def streak_px(picture: NDArray[np.uint8], field: Field, agreeing: int, meter: Meter) -> float:
    """Length of streaks too faint for single pixels; 0 below `SHORTEST_PX`.

    Args:
        picture: (rows, columns) grey levels.
        field: the camera; blocks that are not wholly in its field do not count.
        agreeing: so many streaks must be about as long: stray light makes one, not two alike.
        meter: charged.
    """
    sums = _blocks(picture).sum(axis=(1, 3), dtype=np.int32)
    inside = _blocks(field.mask).all(axis=(1, 3))
    low, middle, high = np.percentile(sums[inside], (25, 50, 75))
    level = middle + BLOCK_SIGMAS * (high - low) / QUARTILES_APART
    blocks = int(inside.sum())
    steps = picture.size + (2 + 16) * blocks  # quartiles by halving the range of 16 bits
    meter.charge(pixel_read=picture.size, i32_add=steps, ram_write=2 * blocks, loop=steps)
    regions = find_regions((sums > level) & inside, meter)
    if regions is None:
        return 0.0
    lengths = sorted(_lengths(regions, np.ones(len(regions.labels), np.float32), meter))
    if len(lengths) < agreeing or lengths[-agreeing] < ALIKE * lengths[-1]:
        return 0.0
    length = BLOCK * lengths[-agreeing]
    return length if length >= SHORTEST_PX else 0.0


def _blocks(pixels: NDArray[Any]) -> NDArray[Any]:
    """View (rows, BLOCK, columns, BLOCK) without what is left over at the edges."""
    rows, columns = (size // BLOCK for size in pixels.shape)
    return pixels[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)


def _lengths(regions: Regions, weights: NDArray[np.float32], meter: Meter) -> list[float]:
    """Of the largest regions."""
    sizes = np.bincount(regions.labels, minlength=regions.count)
    lengths = []
    for region in np.argsort(-sizes, kind="stable")[:LARGEST]:
        pixels = np.flatnonzero(regions.labels == region)
        lengths.append(_length(regions.rows[pixels], regions.columns[pixels], weights[pixels]))
        meter.charge(
            ram_read=3 * len(pixels),
            f32_convert=3 * len(pixels),
            f32_mul=8 * len(pixels),
            f32_add=6 * len(pixels),
            f32_div=5,
            f32_sqrt=2,
            loop=len(pixels),
        )
    meter.charge(i32_add=len(regions.labels), loop=len(regions.labels) + LARGEST * regions.count)
    return lengths


def _length(
    rows: NDArray[np.intp], columns: NDArray[np.intp], weights: NDArray[np.float32]
) -> float:
    """Length of the streak that pixels (n,) with weights make."""
    y, x = (rows - rows[0]).astype(np.float32), (columns - columns[0]).astype(np.float32)
    total = weights.sum()
    x, y = x - (weights @ x) / total, y - (weights @ y) / total
    across, down = weights @ (x * x) / total, weights @ (y * y) / total
    mixed = weights @ (x * y) / total
    return float(np.sqrt(12 * np.sqrt((across - down) ** 2 + 4 * mixed**2)))
