"""Upsets in memory: radiation inverts bits, each with the same probability."""

import numpy as np
from numpy.typing import NDArray


def flip_bits(memory: NDArray[np.uint8], rate: float, generator: np.random.Generator) -> int:
    """Invert each bit of ``memory`` with probability ``rate``, 0..1; return their number."""
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of bit flips must be 0 to 1 per bit, not {rate:g}")
    bits = 8 * memory.size
    count = int(generator.binomial(bits, rate))
    for place in generator.choice(bits, count, replace=False, shuffle=False):
        flip_bit(memory, int(place))
    return count


def flip_bit(memory: NDArray[np.uint8], place: int) -> None:
    """Invert bit ``place``, counted from the lowest bit of the first byte."""
    memory[place // 8] ^= np.uint8(1 << place % 8)
