"""Error-correcting code of the catalogue: one bit in 72 corrected, two detected.

AraMiS thesis, sections 2.1 (an error-correcting code), 2.3.2 and 2.3.3 (room for a Hamming code in
flash and RAM).
Assumed: one whose 72 columns all have an odd number of ones (Hsiao, "A Class of Optimal Minimum
Odd-weight-column SEC-DED Codes", 1970): 64 bits of data, 8 check bits. A syndrome with an odd
number of ones is a single error if a column matches; with an even number it is two errors.

A coded word is 9 bytes: 8 of data, then the check byte. The lowest bit of the first byte is bit 0.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Indices
from cubestack.firmware_model.mcu.costs import Meter

DATA_BYTES = 8
CODED_BYTES = 9

DATA_BITS = 8 * DATA_BYTES
LOST = -1


def _columns() -> list[int]:
    """Columns of the 64 data bits: all 56 bytes with three ones, then the first 8 with five."""
    return [
        sum(1 << bit for bit in bits) for ones in (3, 5) for bits in combinations(range(8), ones)
    ][:DATA_BITS]


def _tables() -> tuple[NDArray[np.uint8], NDArray[np.int16]]:
    """Check byte per data byte and value (8, 256), and wrong bit per non-zero syndrome (256,)."""
    checks = np.zeros((DATA_BYTES, 256), np.uint8)
    located = np.full(256, LOST, np.int16)
    located[1 << np.arange(8)] = DATA_BITS + np.arange(8)
    for bit, column in enumerate(_columns()):
        checks[bit // 8] ^= ((np.arange(256) >> bit % 8 & 1) * column).astype(np.uint8)
        located[column] = bit
    return checks, located


_CHECKS, _LOCATED = _tables()


@dataclass(frozen=True, eq=False)
class Decoded:
    """Result of decoding."""

    data: NDArray[np.uint8]  #: bytes (8 n,), uint8
    checks: NDArray[np.uint8]  #: check bytes (n,), uint8
    corrected: int  #: number of words with one wrong bit, which was corrected
    lost: Indices  #: indices of words with more than one


def coded_size(size: int) -> int:
    """Bytes of the coded words of ``size`` bytes of data."""
    return -(-size // DATA_BYTES) * CODED_BYTES


def encode(data: bytes) -> NDArray[np.uint8]:
    """Coded words of ``data``, padded with zeros to a whole word."""
    words = np.zeros((-(-len(data) // DATA_BYTES), CODED_BYTES), np.uint8)
    flat = np.frombuffer(data.ljust(len(words) * DATA_BYTES, b"\0"), np.uint8)
    words[:, :DATA_BYTES] = flat.reshape(-1, DATA_BYTES)
    words[:, DATA_BYTES] = _check(words)
    return words.reshape(-1)


def decode(coded: NDArray[np.uint8], meter: Meter) -> Decoded:
    """Data of whole coded words (9 n,), single errors corrected.

    Raises:
        ValueError: for a part of a word.
    """
    if len(coded) % CODED_BYTES:
        raise ValueError(f"coded data comes in words of {CODED_BYTES} bytes, not {len(coded)}")
    words = coded.reshape(-1, CODED_BYTES)
    data, checks = words[:, :DATA_BYTES].copy(), words[:, DATA_BYTES].copy()
    corrected, lost = mend(data, checks)
    meter.charge(flash_read=-(-len(coded) // 2), coded_word=len(words))
    meter.charge(correction=corrected + len(lost), loop=len(words), ram_write=2 * len(words))
    return Decoded(data.reshape(-1), checks, corrected, lost)


def mend(data: NDArray[np.uint8], checks: NDArray[np.uint8]) -> tuple[int, Indices]:
    """Correct single errors of words ``data`` (n, 8) and ``checks`` (n,) in place; not charged.

    Returns the number of words with one wrong bit, and the indices of those with more.
    """
    syndromes = _check(data) ^ checks
    wrong = np.flatnonzero(syndromes)
    bits = _LOCATED[syndromes[wrong]]
    single = bits >= 0
    for part, chosen in ((data, single & (bits < DATA_BITS)), (checks, bits >= DATA_BITS)):
        at, bit = wrong[chosen], bits[chosen]
        part[(at, bit // 8) if part is data else at] ^= (1 << bit % 8).astype(np.uint8)
    return int(single.sum()), wrong[~single]


def _check(words: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Check byte (n,) of the data in words (n, 8 or more)."""
    check = np.zeros(len(words), np.uint8)
    for place in range(DATA_BYTES):
        check ^= _CHECKS[place][words[:, place]]
    return check
