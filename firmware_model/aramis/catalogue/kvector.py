"""The k-vector: a range of sorted values found without a search.

AraMiS thesis, sections 5.6 and 7.1.2. A curve similar to the sorted values maps a value to a bin,
and the k-vector holds the start of each bin. The published curve is a parabola through the smallest
and the largest value, with its vertex at the largest. The bins of the two bounds also hold values
outside of the range; comparisons remove them, so a range is the same as from comparing all values.
(The thesis does not say so; its ground code takes whole bins.)

Ground and flight compute the bins with the same single-precision arithmetic. It never decreases
with a rising value, so rounding moves no value out of the range.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.mcu.costs import Meter

VALUES_PER_BIN = 4  #: mean size of a bin: larger ones save memory, cost comparisons (assumed)

_ZERO, _ONE = np.float32(0), np.float32(1)

#: A list with a smaller span is one bin: the inverse of the span would not be finite.
_NARROWEST = np.finfo(np.float32).tiny


@dataclass(frozen=True)
class Range:
    """Places `start` to `stop` (excluded) in the sorted values, and the number of examined ones."""

    start: int
    stop: int
    looked_at: int

    def __len__(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True, eq=False)
class KVector:
    """The bins of one sorted list."""

    #: lowest, highest: smallest and largest value of the list
    lowest: np.float32
    highest: np.float32
    #: (bins + 1,) start of each bin in the list, uint32; the last is its length
    starts: NDArray[np.uint32]

    @classmethod
    def build(cls, rising: Floats, values_per_bin: int = VALUES_PER_BIN) -> Self:
        """The k-vector of sorted values (n,), n at least 1."""
        bins = max(1, len(rising) // values_per_bin)
        vector = cls(rising[0], rising[-1], np.zeros(bins + 1, dtype=np.uint32))
        occupied = np.bincount(vector._bin(rising), minlength=bins)
        starts = np.concatenate([[0], np.cumsum(occupied)]).astype(np.uint32)
        return cls(rising[0], rising[-1], starts)

    @property
    def bins(self) -> int:
        return len(self.starts) - 1

    def find(self, rising: Floats, low: np.float32, high: np.float32, meter: Meter) -> Range:
        """Range of the values from `low` to `high`, both included; NaN finds nothing."""
        meter.charge(f32_compare=3)
        if not (low <= high and low <= self.highest and high >= self.lowest):
            return Range(0, 0, 0)
        first, last = self._bin(np.array([low, high], dtype=np.float32)).tolist()
        start, stop = int(self.starts[first]), int(self.starts[last + 1])
        meter.charge(f32_add=4, f32_mul=6, f32_compare=4, f32_convert=2, ram_read=2)
        looked_at, compared = stop - start, 2
        while start < stop and rising[start] < low:
            start += 1
            compared += 1
        while start < stop and rising[stop - 1] > high:
            stop -= 1
            compared += 1
        meter.charge(ram_read=compared, f32_compare=compared, loop=compared)
        return Range(start, stop, looked_at)

    def _bin(self, values: Floats) -> Indices:
        """Bins of values of any shape: the parabola (top - y)^2 = (top - lowest)^2 (1 - x)."""
        span = self.highest - self.lowest
        scale = _ONE / span if span >= _NARROWEST else _ZERO
        below = np.clip((self.highest - values) * scale, _ZERO, _ONE)
        numbers: Floats = (_ONE - below * below) * np.float32(self.bins - 1)
        return numbers.astype(np.intp)
