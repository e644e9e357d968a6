"""Bright areas of a picture, row by row: runs of bright pixels that touch are one area.

The program keeps three rows of the picture and the runs of two. Pixels that are much brighter than
their neighbours are no part of any spot and are left out first (hot pixels, particles). A run that
is longer than any spot makes its area large, unseen.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LONGEST_RUN = 32
"""Pixels of a row: longer ones belong to the Moon, the limb, or a streak too long to be used."""

_SPIKE = 3, 5
"""A pixel whose four neighbours hold less than 3/5 of its own signal is a spike. They hold
2.3 times as much in the middle of a spot of sigma 0.9 px, and 0.7 in one of 0.45 px; chosen."""

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Areas:
    """Connected areas, (n,) each, in the order of their first pixels.

    Attributes:
        sizes: pixels.
        large: there was a run longer than `LONGEST_RUN`; the rest then counts the short ones.
        peaks: place of the brightest pixel, as an offset into the region.
        tops: its signal in 1/16 DN.
        light: sum of the signal in 1/16 DN.
        middles: (n, 2) mean x and y in px, weighted by the signal.
        moments: (n, 3) variances in x and y, and covariance, in px^2, weighted by the signal.
    """

    sizes: Ints
    large: NDArray[np.bool_]
    peaks: Ints
    tops: Ints
    light: NDArray[np.float64]
    middles: NDArray[np.float64]
    moments: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of bright pixels: first offset and offset behind the last one, (n,) each."""

    begins: Ints
    ends: Ints

    @property
    def short(self) -> NDArray[np.bool_]:
        """Which runs may be part of a spot."""
        return self.ends - self.begins <= LONGEST_RUN

    def places(self) -> Ints:
        """Offsets of the pixels of the short runs, (p,)."""
        begins, lengths = self.begins[self.short], (self.ends - self.begins)[self.short]
        first = np.cumsum(lengths) - lengths
        places: Ints = np.arange(lengths.sum()) + np.repeat(begins - first, lengths)
        return places


def runs_of(bright: NDArray[np.bool_]) -> Runs:
    """Runs of a mask (rows, columns) whose last column is False."""
    edges = np.flatnonzero(np.diff(bright.reshape(-1).view(np.int8), prepend=np.int8(0)))
    return Runs(edges[::2], edges[1::2])


def spikes(
    pixels: NDArray[np.uint8], places: Ints, width: int, levels: Ints, noises: Ints
) -> NDArray[np.bool_]:
    """Which of the ``places`` (n,) are spikes; levels and noises (n,) in 1/16 DN."""
    around = sum(pixels[places + step].astype(np.int64) for step in (-width, -1, 1, width))
    own = 16 * pixels[places].astype(np.int64) - levels
    share, beside = _SPIKE[0], _SPIKE[1] * (16 * around - 4 * levels)
    sharp: NDArray[np.bool_] = beside < share * (own - 2 * noises)
    return sharp


def without(runs: Runs, places: Ints) -> Runs:
    """The ``runs`` with gaps at the ``places`` (p,)."""
    steps = np.concatenate([runs.begins, places + 1]), np.concatenate([runs.ends, places])
    begins, ends = (np.sort(step) for step in steps)
    some = begins < ends
    return Runs(begins[some], ends[some])


def join(runs: Runs, width: int) -> Ints:
    """Number of each run's area (n,), areas in the order of their first runs."""
    begins, ends = runs.begins, runs.ends
    # Runs of the row below touch that end behind, and begin before, this one moved down by a row;
    # corners count.
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
    areas: Ints = np.unique(labels, return_inverse=True)[1].reshape(-1)
    return areas


def measure(runs: Runs, labels: Ints, signal: Ints, width: int) -> Areas:
    """Areas of ``runs`` with ``labels``; ``signal`` in 1/16 DN is that of their ``places()``."""
    count = int(labels.max()) + 1 if len(labels) else 0
    large = np.zeros(count, np.bool_)
    large[labels[~runs.short]] = True
    places = runs.places()
    owners = np.repeat(labels[runs.short], (runs.ends - runs.begins)[runs.short])
    first = np.full(count, width * width, np.int64)
    np.minimum.at(first, labels, runs.begins)
    top, left = np.divmod(first, width)
    y, x = np.divmod(places, width)
    dy, dx = y - top[owners], x - left[owners]

    def mean(values: Ints) -> NDArray[np.float64]:
        weighted: NDArray[np.float64] = np.bincount(owners, signal * values, count) / light
        return weighted

    light = np.maximum(np.bincount(owners, signal, count), 1)
    mean_x, mean_y = mean(dx), mean(dy)
    squares = mean(dx * dx) - mean_x**2, mean(dy * dy) - mean_y**2, mean(dx * dy) - mean_x * mean_y
    by_area = np.lexsort((signal, owners))
    last = np.cumsum(np.bincount(owners, minlength=count)) - 1
    brightest = by_area[last] if len(by_area) else last
    return Areas(
        sizes=np.bincount(owners, minlength=count),
        large=large,
        peaks=places[brightest] if len(places) else first,
        tops=signal[brightest] if len(places) else light,
        light=light,
        middles=np.stack([left + mean_x, top + mean_y], axis=1),
        moments=np.stack(squares, axis=1),
    )
