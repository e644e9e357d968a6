"""Noise of a frame from counters: the number of any pixel can be computed alone.

Salmon et al., "Parallel random numbers: as easy as 1, 2, 3" (SC11), section 3.3: Philox4x64-10. Of
the paper's generators this is the one that NumPy has too, so that NumPy is an independent reference
for `noise.h`. A frame's seeds give the key, and the place of a pixel the counter: pixel i, counted
row by row, has the 32 bits number i of the stream, the lower half of a word of 64 bits first.

The 32 bits become a normal number by the inverse distribution function: the highest is the sign,
the others are the probability of the tail. The function is linear in `SEGMENTS` pieces of each
power of two, so its error is below 2e-4, and tails reach 6.3 standard deviations.
"""

from collections.abc import Sequence
from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Normals = NDArray[np.float32]

SEGMENTS_LOG2 = 5
SEGMENTS = 1 << SEGMENTS_LOG2
SHIFT = 23 - SEGMENTS_LOG2  # from a float32's bits to its segment
LOWEST, OCTAVES = 0.5, 32  # of the probabilities, in units of 2**-32
FIRST = int(np.float32(LOWEST).view(np.int32)) >> SHIFT


class FrameNoise:
    """Normal numbers of one frame, which depend on ``seeds`` (0 or above) alone."""

    def __init__(self, seeds: Sequence[int]) -> None:
        self.seeds = tuple(seeds)
        #: the generator's key, (2,)
        self.key = np.random.SeedSequence(seeds).generate_state(2, np.uint64).astype(np.uint64)

    def words(self, first: int, count: int) -> NDArray[np.uint32]:
        """Uniform 32 bits of the pixels ``first`` to ``first + count - 1``, (count,)."""
        block, skipped = divmod(first, 8)
        stream = np.random.Philox(key=self.key, counter=block)
        halves = stream.random_raw((skipped + count + 1) // 2).view(np.uint32)
        return halves[skipped : skipped + count]

    def normals(self, first: int, count: int) -> Normals:
        """Normal numbers, mean 0 and variance 1, of the same pixels, (count,)."""
        return normals_of(self.words(first, count))


def normals_of(words: NDArray[np.uint32]) -> Normals:
    """Normal numbers of uniform 32 bits, same shape."""
    tail = (words & np.uint32(0x7FFFFFFF)).astype(np.int32).astype(np.float32)
    tail += np.float32(LOWEST)
    levels, slopes = pieces()
    segment = (tail.view(np.int32) >> SHIFT) - FIRST
    size = slopes[segment] * tail
    size += levels[segment]
    sign: NDArray[np.uint32] = words & np.uint32(0x80000000)
    signed: Normals = (size.view(np.uint32) ^ sign).view(np.float32)
    return signed


@cache
def pieces() -> tuple[Normals, Normals]:
    """Level and slope of the inverse distribution function in each segment of the tail."""
    octaves = np.repeat(LOWEST * 2.0 ** np.arange(OCTAVES), SEGMENTS)
    starts = octaves * np.tile(1 + np.arange(SEGMENTS) / SEGMENTS, OCTAVES)
    starts = np.append(starts, LOWEST * 2.0**OCTAVES)
    quantile = np.array([-NormalDist().inv_cdf(one / 2**32) for one in starts])
    slopes = np.append(np.diff(quantile) / np.diff(starts), 0.0)
    levels = quantile - slopes * starts
    # A chord of this curve is too high; by two thirds of the distance in its middle on average.
    middle = np.array(
        [-NormalDist().inv_cdf(one / 2**32) for one in starts[:-1] + np.diff(starts) / 2]
    )
    levels[:-1] -= 2 / 3 * ((quantile[:-1] + quantile[1:]) / 2 - middle)
    return levels.astype(np.float32), slopes.astype(np.float32)
