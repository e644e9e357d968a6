"""Stars from the mask: connected regions and their weighted centroids.

AraMiS thesis, section 3.6 (equation 3.10) and section 7.3. Pixels that touch, by a side or a
corner, are one star; its grey levels are the weights. Weighing the plain grey level, as the thesis
does, draws the centroid to the middle of the region as soon as there is background; `floor`
subtracts a level first (an extension).
"""

from dataclasses import dataclass
from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Indices, Mask
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.mcu.costs import Meter

MOST_RUNS = 20_000
"""Runs of pixels that the list in RAM holds (assumed); a picture of stars has some hundred."""


@dataclass(frozen=True, eq=False)
class Regions:
    """Connected regions of a mask.

    Attributes:
        rows, columns: (p,) the pixels of all regions.
        labels: (p,) region of each pixel, 0 to count - 1.
        count: number of regions.
    """

    rows: Indices
    columns: Indices
    labels: Indices
    count: int


_NONE = np.zeros(0, np.intp)
NO_REGIONS = Regions(_NONE, _NONE, _NONE, 0)


def find_regions(mask: Mask, meter: Meter) -> Regions | None:
    """Regions of a mask (rows, columns); None when it has more than `MOST_RUNS` runs of pixels.

    One pass lists the runs of each row, a second joins runs of neighbouring rows that touch.
    """
    width = mask.shape[1] + 1
    padded = np.zeros((mask.shape[0], width), dtype=np.int8)
    padded[:, :-1] = mask
    edges = np.diff(padded.ravel(), prepend=0)
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    meter.charge(table_byte=mask.size, i32_add=mask.size, loop=mask.size)
    if len(starts) > MOST_RUNS:
        return None
    parents = _join(starts, stops, width, meter)
    _, run_labels = np.unique(parents, return_inverse=True)
    lengths = stops - starts
    rows, columns = np.divmod(np.flatnonzero(padded), width)
    count = int(run_labels.max()) + 1 if len(run_labels) else 0
    return Regions(rows, columns, np.repeat(run_labels.ravel(), lengths), count)


def locate_stars(
    picture: NDArray[np.uint8],
    regions: Regions,
    floor: int,
    min_pixels: int,
    max_pixels: int,
    meter: Meter,
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
    sizes = np.bincount(labels, minlength=count)
    pixels = len(labels)
    meter.charge(pixel_read=pixels, ram_read=2 * pixels, i32_add=6 * pixels, i32_mul=2 * pixels)
    meter.charge(f32_convert=5 * count, f32_div=2 * count, f32_add=2 * count, loop=pixels + count)
    used = np.flatnonzero((sizes >= min_pixels) & (sizes <= max_pixels) & (total > 0))
    scale = total[used].astype(np.float32)
    corner = np.stack([left, top])[:, used].astype(np.float32)
    centroids = (corner + np.stack([across, down])[:, used].astype(np.float32) / scale).T
    order = np.argsort(-scale, kind="stable")
    steps = len(used) * ceil(log2(len(used) + 1))
    meter.charge(f32_compare=steps, ram_read=steps, ram_write=steps, loop=steps)
    return StarList(centroids[order], scale[order])


def _join(starts: Indices, stops: Indices, width: int, meter: Meter) -> Indices:
    """Smallest run of the region of each run (n,): runs touch with their corners too."""
    parents = list(range(len(starts)))

    def root(run: int) -> int:
        while parents[run] != run:
            parents[run] = parents[parents[run]]
            run = parents[run]
        return run

    begins, ends = starts.tolist(), stops.tolist()
    above = looks = 0
    for run, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        while above < run and ends[above] + width < begin:
            above += 1
            looks += 1
        other = above
        while other < run and begins[other] + width <= end:
            first, second = sorted((root(other), root(run)))
            parents[second] = first
            other += 1
            looks += 1
    runs = len(begins)
    meter.charge(ram_read=6 * looks + 2 * runs, ram_write=looks + 3 * runs)
    meter.charge(i32_add=4 * looks + 2 * runs, loop=looks + runs)
    return np.array([root(run) for run in range(runs)], dtype=np.intp)
