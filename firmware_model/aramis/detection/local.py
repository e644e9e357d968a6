"""What is brighter than the sky around it: a threshold for every place of one picture.

An extension: the thesis has one threshold for the whole picture, from the last five (section 3.5).
A gradient of stray light, the Moon or the Earth's limb lift parts of a picture above it, and hot
pixels widen it. Here the picture is cut into blocks; each has a level, its median, and a noise, the
mean difference of neighbours without the largest eighth, so that neither stars nor spikes count.
Between the blocks' middles both are interpolated, in integers.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Mask
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.mcu.costs import Meter

BLOCK = 32
"""Pixels along a side of a block: the middle of one holds a star even if it is out of focus."""

STEP = 2
"""Of a block every second pixel of every second row is looked at."""

KEPT = 7 / 8
"""Share of the differences that the noise is the mean of."""

KEPT_MEAN = 0.892
"""That mean for normal noise, in standard deviations of a pixel."""

LEAST_NOISE = 1.2
"""Counts; the converter's steps hide less, and levels near 0 are cut off there."""

UNIT = 64
"""Levels are held in so many parts of a count."""

BLIND = 240
"""Level from which on no star can be told from its surroundings."""

Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Sky:
    """Levels of one picture.

    Attributes:
        levels: (b, c) median of each block, in counts.
        noise: (b, c) standard deviation of a pixel in each block, in counts.
        seen: (b, c) which blocks have their middle in the field.
    """

    levels: NDArray[np.float32]
    noise: NDArray[np.float32]
    seen: Mask

    @cached_property
    def level(self) -> float:
        """Median level over the field."""
        return float(np.median(self.levels[self.seen]))

    @cached_property
    def deviation(self) -> float:
        """Median noise over the field."""
        return float(np.median(self.noise[self.seen]))

    @cached_property
    def spread(self) -> float:
        """Between the levels that a twentieth of the field is below and above."""
        low, high = np.percentile(self.levels[self.seen], (5, 95))
        return float(high - low)

    @cached_property
    def blind(self) -> float:
        """Share of the field that is too bright for stars, 0 to 1."""
        return float(np.mean(self.levels[self.seen] >= BLIND))


def measure_sky(picture: NDArray[np.uint8], field: Field, meter: Meter) -> Sky:
    """Level and noise of each block of a picture (rows, columns)."""
    rows, columns = (-(-size // BLOCK) for size in picture.shape)
    whole = np.pad(
        picture,
        ((0, rows * BLOCK - picture.shape[0]), (0, columns * BLOCK - picture.shape[1])),
        mode="edge",
    )
    looked = whole[::STEP, ::STEP]
    side = BLOCK // STEP
    blocks = looked.reshape(rows, side, columns, side)
    count = side * side
    flat = blocks.transpose(0, 2, 1, 3).reshape(rows, columns, count)
    levels = np.median(flat, axis=2)
    upper, lower = blocks[:, :, :, 1:], blocks[:, :, :, :-1]
    apart = np.where(upper > lower, upper - lower, lower - upper).transpose(0, 2, 1, 3)
    apart = np.sort(apart.reshape(rows, columns, -1), axis=2)
    kept = int(KEPT * apart.shape[2])
    noise = apart[:, :, :kept].mean(axis=2, dtype=np.float32) / np.float32(KEPT_MEAN)
    # Two histograms of 256 bins a block, filled and added up.
    values, bins = 2 * rows * columns * count, 2 * rows * columns * 256
    meter.charge(pixel_read=values, i32_add=2 * values, table_byte=values, loop=values)
    meter.charge(table_byte=2 * bins, i32_add=bins, i32_mul=bins // 2, loop=bins)
    middles = np.ix_(_middles(rows, picture.shape[0]), _middles(columns, picture.shape[1]))
    smooth = np.median(_around(levels), axis=0)
    meter.charge(i32_add=30 * levels.size, table_byte=9 * levels.size, loop=9 * levels.size)
    return Sky(
        smooth.astype(np.float32),
        np.maximum(np.median(_around(noise), axis=0), np.float32(LEAST_NOISE)).astype(np.float32),
        field.mask[middles],
    )


def brighter(picture: NDArray[np.uint8], above: NDArray[np.float32], meter: Meter) -> Mask:
    """Which pixels of a picture (rows, columns) are above a level (b, c) given for each block."""
    levels = interpolated(above, picture.shape)
    pixels = picture.size
    meter.charge(pixel_read=pixels, i32_add=2 * pixels, ram_write=pixels // 4, loop=pixels)
    return picture > levels


def interpolated(blocks: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Whole counts at each pixel between values (b, c) at the middles of blocks, at most 255."""
    rows, columns = shape
    values = np.minimum(np.rint(blocks * UNIT), 255 * UNIT).astype(np.int32)
    for axis, size in ((0, rows), (1, columns)):
        place = np.clip(2 * np.arange(size) + 1 - BLOCK, 0, 2 * BLOCK * (values.shape[axis] - 1))
        first, part = np.divmod(place, 2 * BLOCK)
        second = np.minimum(first + 1, values.shape[axis] - 1)
        part = part.reshape((-1, 1) if axis == 0 else (1, -1)).astype(np.int32)
        low = values.take(first, axis)
        values = low + (values.take(second, axis) - low) * part // (2 * BLOCK)
    return (values // UNIT).astype(np.uint8)


def _middles(blocks: int, size: int) -> NDArray[np.intp]:
    return np.minimum(np.arange(blocks) * BLOCK + BLOCK // 2, size - 1)


def _around(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Each value (b, c) and its eight neighbours, (9, b, c)."""
    padded = np.pad(values, 1, mode="edge")
    rows, columns = values.shape
    return np.stack([padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)])
