"""Connected regions of bright pixels: runs along the rows, joined where they touch, and moments."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.inner_loops import INT, INTS, MARKS, Loop

Ints = NDArray[np.int64]
Reals = NDArray[np.float64]
Marks = NDArray[np.bool_]

_OF = Loop("runs_of", MARKS, INT, INT, INT, INTS, INT)
_JOIN = Loop("runs_join", INTS, INTS, INT, INT, INTS)


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of bright pixels: first offset and offset behind the last one, (n,) each."""

    begins: Ints
    ends: Ints

    @classmethod
    def of(cls, bright: Marks, gap: int = 0) -> Self:
        """Runs of a mask (rows, columns), as if ``gap`` dark pixels followed each row.

        Without a gap the mask's last column is False.
        """
        if _OF:
            marks, most = np.ascontiguousarray(bright), 4096
            while True:
                edges = np.empty(most, np.int64)
                found = _OF(marks, *marks.shape, gap, edges, most)
                if found <= most:
                    return cls(edges[:found:2], edges[1:found:2])
                most = found
        flat = np.pad(bright, ((0, 0), (0, gap))).reshape(-1)
        edges = np.flatnonzero(np.diff(flat.view(np.int8), prepend=np.int8(0)))
        return cls(edges[::2], edges[1::2])

    def __len__(self) -> int:
        return len(self.begins)

    def __getitem__(self, which: Marks) -> "Runs":
        return Runs(self.begins[which], self.ends[which])

    @property
    def lengths(self) -> Ints:
        """Pixels (n,) of each."""
        return self.ends - self.begins

    def places(self) -> Ints:
        lengths = self.lengths
        first = np.cumsum(lengths) - lengths
        places: Ints = np.arange(lengths.sum()) + np.repeat(self.begins - first, lengths)
        return places

    def without(self, places: Ints) -> "Runs":
        """The runs with gaps at the ``places`` (p,)."""
        steps = (np.concatenate([self.begins, places + 1]), np.concatenate([self.ends, places]))
        begins, ends = (np.sort(step) for step in steps)
        return Runs(begins, ends)[begins < ends]

    def join(self, width: int) -> tuple[Ints, int]:
        """Number of each run's region (n,), in the order of their first runs, and the number of
        pairs of runs that touch, by sides or corners, in a picture of a ``width``."""
        begins, ends = self.begins, self.ends
        if _JOIN:
            begins, ends = np.ascontiguousarray(begins), np.ascontiguousarray(ends)
            labels = np.empty(len(begins), np.int64)
            return labels, _JOIN(begins, ends, len(begins), width, labels)
        # Runs of the row below touch that end behind, and begin before, this one moved down by a
        # row; corners count.
        first = np.searchsorted(ends, begins + width, "left")
        last = np.searchsorted(begins, ends + width, "right")
        touching = np.maximum(last - first, 0)
        above = np.repeat(np.arange(len(begins)), touching)
        starts = np.cumsum(touching) - touching
        below = np.arange(len(above)) - np.repeat(starts - first, touching)
        labels = np.arange(len(begins))
        while True:
            low, high = labels[above], labels[below]
            if np.array_equal(low, high):
                break
            low, high = np.minimum(low, high), np.maximum(low, high)
            np.minimum.at(labels, high, low)
            while not np.array_equal(labels, labels[labels]):
                labels = labels[labels]
        return np.unique(labels, return_inverse=True)[1].reshape(-1), len(above)


@dataclass(frozen=True, eq=False)
class Moments:
    """Weighted moments of regions, (n,) each."""

    light: Reals  #: sum of the weights, 1 at least where ``of`` is given whole numbers
    #: mean place in px
    x: Reals
    y: Reals
    #: variances and covariance in px^2
    xx: Reals
    yy: Reals
    xy: Reals

    @classmethod
    def of(
        cls,
        labels: Ints,
        weights: NDArray[Any],
        rows: Ints,
        columns: Ints,
        corners: tuple[Ints, Ints],
        least: float = 1.0,
    ) -> Self:
        """Of pixels (p,) in regions ``labels``; sums count from the regions' ``corners``, rows and
        columns (n,). ``least``: smallest sum of the weights."""
        top, left = corners
        count = len(top)
        light = np.maximum(np.bincount(labels, weights, count), least)
        y, x = rows - top[labels], columns - left[labels]

        def mean(values: Ints) -> Reals:
            weighted: Reals = np.bincount(labels, weights * values, count) / light
            return weighted

        mx, my = mean(x), mean(y)
        return cls(
            light,
            left + mx,
            top + my,
            mean(x * x) - mx**2,
            mean(y * y) - my**2,
            mean(x * y) - mx * my,
        )

    @cached_property
    def spread(self) -> Reals:
        """Difference of the variances along and across each region, in px^2."""
        spread: Reals = np.hypot(self.xx - self.yy, 2 * self.xy)
        return spread

    @cached_property
    def along(self) -> Reals:
        return (self.xx + self.yy + self.spread) / 2

    @cached_property
    def across(self) -> Reals:
        return (self.xx + self.yy - self.spread) / 2

    @property
    def doubled_angle(self) -> Reals:
        """Twice the direction of the largest variance, -pi to pi."""
        angle: Reals = np.arctan2(2 * self.xy, self.xx - self.yy)
        return angle
