"""Stars from the mask: connected regions and their weighted centroids.

AraMiS thesis, section 3.6 (equation 3.10) and section 7.3. Pixels that touch, by a side or a
corner, are one star; its grey levels are the weights. Weighing the plain grey level, as the thesis
does, draws the centroid to the middle of the region as soon as there is background; `floor`
subtracts a level first (an extension).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Indices, Mask
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.star_tracker.regions import Moments, Runs

#: Runs of pixels that the list in RAM holds (assumed); a picture of stars has some hundred.
MOST_RUNS = 20_000


@dataclass(frozen=True, eq=False)
class Regions:
    """Connected regions of a mask."""

    #: (p,) the pixels of all regions
    rows: Indices
    columns: Indices
    labels: Indices  #: (p,) region of each pixel, 0 to count - 1
    count: int  #: number of regions
    #: runs of pixels, and comparisons of two runs, to find them
    runs: int = 0
    comparisons: int = 0

    @cached_property
    def sizes(self) -> Indices:
        return np.bincount(self.labels, minlength=self.count)

    @cached_property
    def box(self) -> tuple[Indices, Indices, Indices, Indices]:
        """First row and column, last row and column (n,) of each region."""
        first = np.full((2, self.count), np.iinfo(np.intp).max)
        last = np.zeros((2, self.count), np.intp)
        pixels = np.stack([self.rows, self.columns])
        for axis in (0, 1):
            np.minimum.at(first[axis], self.labels, pixels[axis])
            np.maximum.at(last[axis], self.labels, pixels[axis])
        (top, left), (bottom, right) = first, last
        return top, left, bottom, right

    def only(self, chosen: Mask) -> "Regions":
        pixels = np.flatnonzero(chosen[self.labels])
        numbers = np.cumsum(chosen) - 1
        return Regions(
            self.rows[pixels],
            self.columns[pixels],
            numbers[self.labels[pixels]],
            int(np.count_nonzero(chosen)),
        )

    def moments(self, weights: NDArray[np.floating], least: float) -> Moments:
        """Moments of pixels weighted by ``weights`` (p,), whose sums are ``least`` at least."""
        return Moments.of(self.labels, weights, self.rows, self.columns, self.box[:2], least)


_NONE = np.zeros(0, np.intp)
NO_REGIONS = Regions(_NONE, _NONE, _NONE, 0)


def find_regions(mask: Mask) -> Regions | None:
    """Regions of a mask (rows, columns); None when it has more than `MOST_RUNS` runs of pixels.

    One pass lists the runs of each row, a second joins runs of neighbouring rows that touch.
    """
    runs, width = Runs.of(mask, gap=1), mask.shape[1] + 1
    if len(runs) > MOST_RUNS:
        return None
    labels, touching = runs.join(width)
    above = 0  # runs of the rows above that were passed by
    if len(runs):
        above = min(int(np.searchsorted(runs.ends, runs.begins[-1] - width)), len(runs) - 1)
    rows, columns = np.divmod(runs.places(), width)
    count = int(labels.max(initial=-1)) + 1
    pixels = np.repeat(labels, runs.lengths)
    return Regions(rows, columns, pixels, count, len(runs), touching + above)


def locate_stars(
    picture: NDArray[np.uint8], regions: Regions, floor: int, min_pixels: int, max_pixels: int
) -> StarList:
    """Centroid and brightness of each region of `min_pixels` to `max_pixels`, brightest first.

    Sums are integers, counted from the region's first pixel, so nothing overflows 32 bits.
    """
    labels, count = regions.labels, regions.count
    if count == 0:
        return StarList(np.zeros((0, 2), np.float32), np.zeros(0, np.float32))
    weight = np.maximum(picture[regions.rows, regions.columns].astype(np.int64) - floor, 0)
    _, first = np.unique(labels, return_index=True)
    top, left = regions.rows[first], regions.columns[first]
    total = np.bincount(labels, weight, count)
    down = np.bincount(labels, weight * (regions.rows - top[labels]), count)
    across = np.bincount(labels, weight * (regions.columns - left[labels]), count)
    used = np.flatnonzero(
        (regions.sizes >= min_pixels) & (regions.sizes <= max_pixels) & (total > 0)
    )
    scale = total[used].astype(np.float32)
    corner = np.stack([left, top])[:, used].astype(np.float32)
    centroids = (corner + np.stack([across, down])[:, used].astype(np.float32) / scale).T
    order = np.argsort(-scale, kind="stable")
    return StarList(centroids[order], scale[order])
