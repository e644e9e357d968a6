"""How far the stars were drawn out while the picture was taken. An extension: the thesis has none.

A star that moves during the exposure leaves a streak. Its second moments along and across differ by
the square of the streak's length over twelve, as those of a line do, whatever the star's own width.
A long streak of a faint star is lost among the noise of single pixels, and even of blocks of them;
but as all streaks of a turn lie the same way, they show together: the blocks of the picture are
alike to those some way off in that one direction. Stars at rest are alike to nothing. Blocks are
compared in integers, as the processor has no floats.
"""

from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.mcu.costs import Meter

LARGEST = 10
"""Regions looked at."""

UPPER_QUARTILE = 75
"""Of the lengths: long streaks fall apart, and their pieces are shorter."""

BLOCK = 8
"""Pixels along a side of a block."""

NEAREST, FARTHEST = 3, 8
"""Blocks compared are so far apart: farther than a star at rest is wide, nearer than a streak is
long that has to be found."""

DIRECTIONS = 24
"""Looked along, over half a turn."""

CLIPPED_SIGMAS = 4.0
"""A block counts as no brighter than that, so that no bright star outshines the streaks."""

SURROUNDINGS = 6
"""Blocks to either side that a block's brightness is taken against: light that is spread wider is
no streak."""

ALIKE_SIGMAS = 5.5
"""Of what chance makes, above the median direction: stars at rest stay near 4, streaks of 95 px are
above 7."""

QUARTILES_APART = 1.349
"""Between the quartiles of a normal distribution, in standard deviations."""

UNIT = 1024
"""Of a block's brightness, for one sigma: sums of products of a whole picture then fit the
Blackfin's 40-bit accumulator."""

Ints = NDArray[np.int32]


def _lags() -> tuple[tuple[frozenset[tuple[int, int]], ...], tuple[tuple[int, int], ...]]:
    """Rows and columns between compared blocks: of each direction, and all without repetition."""
    reach = range(NEAREST, FARTHEST + 1)
    angles = [pi * number / DIRECTIONS for number in range(DIRECTIONS)]
    directions = tuple(
        frozenset((round(far * sin(angle)), round(far * cos(angle))) for far in reach)
        for angle in angles
    )
    return directions, tuple(sorted(frozenset().union(*directions)))


ALONG, LAGS = _lags()


def smear_px(picture: NDArray[np.uint8], regions: Regions, floor: int, meter: Meter) -> float:
    """Upper quartile of the lengths of the largest regions, weighed by grey levels above `floor`.

    0 without regions.
    """
    grey = picture[regions.rows, regions.columns].astype(np.float32)
    lengths = _lengths(regions, np.maximum(grey - np.float32(floor), 1), meter)
    return float(np.percentile(lengths, UPPER_QUARTILE)) if lengths else 0.0


def is_drawn_out(picture: NDArray[np.uint8], field: Field, meter: Meter) -> bool:
    """Whether a picture (rows, columns) has streaks of some 60 px or more, however faint.

    Blocks near the edge of the field do not count.
    """
    inside: Mask = np.all(_blocks(field.mask), axis=(1, 3))
    inside &= _box(inside.astype(np.int32)) == (2 * SURROUNDINGS + 1) ** 2
    count = int(inside.sum())
    if count == 0:
        return False
    bright = _brightness(picture, inside, meter).astype(np.int64)
    chance = int(np.vdot(bright, bright)) / sqrt(count)
    rows, columns = bright.shape
    alike = {}
    for down, across in LAGS:
        left, right = max(0, -across), columns - max(0, across)
        here = bright[: rows - down, left:right]
        there = bright[down:, left + across : right + across]
        alike[down, across] = int(np.vdot(here, there))
    steps = count * (1 + len(LAGS))
    meter.charge(ram_read=2 * steps, i32_mul=steps, i32_add=steps, loop=steps)
    meter.charge(f32_add=DIRECTIONS * FARTHEST, f32_div=DIRECTIONS, f32_compare=DIRECTIONS)
    directions = [sum(alike[lag] for lag in lags) / sqrt(len(lags)) for lags in ALONG]
    # Light that a glow leaves is alike in all directions.
    return max(directions) - float(np.median(directions)) > ALIKE_SIGMAS * chance


def _brightness(picture: NDArray[np.uint8], inside: Mask, meter: Meter) -> Ints:
    """How much brighter each block is than those around it, in 1 / `UNIT` sigma; 0 outside."""
    sums = _blocks(picture).sum(axis=(1, 3), dtype=np.int32)
    clipped = _clipped(sums, inside)
    level = _box(clipped) // (2 * SURROUNDINGS + 1) ** 2
    blocks = sums.size
    # Quartiles are found by halving the range of 16 bits, twice; then the boxes.
    steps = picture.size + (2 * 16 + 8) * blocks
    meter.charge(pixel_read=picture.size, i32_add=steps, ram_write=4 * blocks, loop=steps)
    meter.charge(i32_div=3 * blocks, i32_mul=2 * blocks)
    return np.where(inside, _clipped(clipped - level, inside), np.int32(0))


def _clipped(values: Ints, inside: Mask) -> Ints:
    """Values (rows, columns) less the median, in 1 / `UNIT` sigma of those inside, clipped."""
    low, middle, high = np.percentile(values[inside], (25, 50, 75), method="lower").astype(np.int32)
    scale = round(UNIT * QUARTILES_APART)
    scaled = (values - middle) * scale // max(high - low, 1)
    most = int(UNIT * CLIPPED_SIGMAS)
    return np.asarray(np.clip(scaled, -most, most), np.int32)


def _box(values: Ints) -> Ints:
    """Sum over the square of `SURROUNDINGS` to all sides of each value (rows, columns)."""
    for axis in (0, 1):
        sums = np.cumsum(np.insert(values, 0, 0, axis=axis), axis=axis, dtype=np.int32)
        places = np.arange(values.shape[axis])
        last = np.minimum(places + SURROUNDINGS + 1, len(places))
        first = np.maximum(places - SURROUNDINGS, 0)
        values = sums.take(last, axis) - sums.take(first, axis)
    return values


def _blocks(pixels: NDArray[Any]) -> NDArray[Any]:
    """View (rows, BLOCK, columns, BLOCK) without what is left over at the edges."""
    rows, columns = (size // BLOCK for size in pixels.shape)
    return pixels[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)


def _lengths(regions: Regions, weights: Floats, meter: Meter) -> list[float]:
    """Of the largest regions."""
    sizes = np.bincount(regions.labels, minlength=regions.count)
    lengths = []
    for region in np.argsort(-sizes, kind="stable")[:LARGEST]:
        pixels = np.flatnonzero(regions.labels == region)
        lengths.append(_length(regions.rows[pixels], regions.columns[pixels], weights[pixels]))
        count = len(pixels)
        meter.charge(ram_read=3 * count, f32_convert=3 * count, f32_div=5, f32_sqrt=2)
        meter.charge(f32_mul=8 * count, f32_add=6 * count, loop=count)
    meter.charge(i32_add=len(regions.labels), loop=len(regions.labels) + LARGEST * regions.count)
    return lengths


def _length(rows: Indices, columns: Indices, weights: Floats) -> float:
    """Length of the streak that pixels (n,) with weights make."""
    y, x = (rows - rows[0]).astype(np.float32), (columns - columns[0]).astype(np.float32)
    total = weights.sum()
    x, y = x - (weights @ x) / total, y - (weights @ y) / total
    across, down = weights @ (x * x) / total, weights @ (y * y) / total
    mixed = weights @ (x * y) / total
    return float(np.sqrt(12 * np.sqrt((across - down) ** 2 + 4 * mixed**2)))
