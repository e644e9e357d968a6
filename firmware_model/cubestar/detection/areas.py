"""Bright areas of a picture, row by row: runs of bright pixels that touch are one area.

The program keeps three rows of the picture and the runs of two. Pixels that are much brighter than
their neighbours are no part of any spot and are left out first (hot pixels, particles). A run that
is longer than any spot marks its area as large, and its pixels are not read.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.star_tracker.regions import Ints, Marks, Moments, Runs

#: Pixels of a row: longer ones belong to the Moon, the limb, or a streak too long to be used.
LONGEST_RUN = 32

#: A pixel whose four neighbours hold less than 3/5 of its own signal is a spike. They hold 2.3
#: times as much in the middle of a spot of sigma 0.9 px, and 0.7 in one of 0.45 px; chosen.
_SPIKE = 3, 5


@dataclass(frozen=True, eq=False)
class Areas:
    """Connected areas, (n,) each, in the order of their first pixels."""

    sizes: Ints  #: pixels
    large: Marks  #: there was a run longer than `LONGEST_RUN`; the rest then counts the short ones
    peaks: Ints  #: place of the brightest pixel, as an offset into the region
    tops: Ints  #: its signal in 1/16 DN
    moments: Moments  #: of the signal in 1/16 DN


def short(runs: Runs) -> Marks:
    return runs.lengths <= LONGEST_RUN


def spikes(
    pixels: NDArray[np.uint8], places: Ints, width: int, levels: Ints, noises: Ints
) -> Marks:
    """Which of the ``places`` (n,) are spikes; levels and noises (n,) in 1/16 DN."""
    around = sum(pixels[places + step].astype(np.int64) for step in (-width, -1, 1, width))
    own = 16 * pixels[places].astype(np.int64) - levels
    share, beside = _SPIKE[0], _SPIKE[1] * (16 * around - 4 * levels)
    sharp: Marks = beside < share * (own - 2 * noises)
    return sharp


def measure(runs: Runs, signal: Ints, width: int) -> Areas:
    """Areas of ``runs``; ``signal`` in 1/16 DN is that of the pixels of the short ones."""
    labels, _ = runs.join(width)
    count, of_spots = int(labels.max(initial=-1)) + 1, short(runs)
    large = np.zeros(count, np.bool_)
    large[labels[~of_spots]] = True
    places = runs[of_spots].places()
    owners = np.repeat(labels[of_spots], runs.lengths[of_spots])
    first = np.full(count, width * width, np.int64)
    np.minimum.at(first, labels, runs.begins)
    y, x = np.divmod(places, width)
    moments = Moments.of(owners, signal, y, x, np.divmod(first, width))
    by_area = np.lexsort((signal, owners))
    last = np.cumsum(np.bincount(owners, minlength=count)) - 1
    brightest = by_area[last] if len(by_area) else last
    return Areas(
        sizes=np.bincount(owners, minlength=count),
        large=large,
        peaks=places[brightest] if len(places) else first,
        tops=signal[brightest] if len(places) else np.ones(count, np.int64),
        moments=moments,
    )
