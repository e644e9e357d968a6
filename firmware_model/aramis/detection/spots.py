"""Which regions of a picture are stars, where they are, and how well that is known.

An extension: the thesis takes every region for a star (section 3.6). Light that is no star is told
by its shape: a star is darker all around, so a ring about it shows limbs, edges and glare; it is
no larger than stars get; and where the others are round, one that is long is a track. A pixel that
outshines its neighbours more than any spot can is hot, and takes their level. The level under a
star is that of its ring, which a gradient does not move.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.mcu.costs import Meter

MOST_REGIONS = 400
"""Regions looked at, the ones with most light first."""

RING = 16
"""Places around a region where the sky is looked at, each the mean of 3 x 3 pixels."""

GAP = 3
"""Pixels between a region and the middle of its ring's places."""

LIT = 0.3
"""A place of the ring is lit that is so far up from the sky to the region's mean."""

MOST_LIT = 4
"""Places of a star's ring that may be lit, by its neighbours."""

SHOT = 0.12
"""Variance of a pixel in counts squared that each count of light brings: that of 8 electrons."""

FLOOR_SHARE = 0.006
"""Error of a centroid that light does not explain, pixels and faint neighbours, as a share of the
root of its area (measured)."""

CUT, CUT_AREA, CUT_LEVEL = 1.8, 60.0, 4.0
"""Where a spot is cut off depends on its noise too, which adds variance, the more so the smaller
and fainter it is: measured over spots of 1.5 to 6 px, levels of 2 to 200 counts and gradients."""

FULL = 250
"""Counts from which a pixel is full, and its region's centroid less sure."""

LONG_PX, LONG_RATIO = 5.0, 2.5
"""A region is long whose streak is longer, and whose moments along and across differ so much."""

_F = np.float32


@dataclass(frozen=True, eq=False)
class Spots:
    """Stars of a picture, the brightest first, and what was left out.

    Attributes:
        centroids: (n, 2) x and y in px.
        brightness: (n,) counts above the sky.
        sigma_px: (n,) expected error of the centroids, each axis.
        length_px: (n,) of the streak that motion could have made of it.
        angle: (n,) direction of that streak, 0 to pi.
        areas: (n,) pixels of them.
        rejected: regions that are no stars by their shape.
        widest: pixels of the largest region.
    """

    centroids: Floats
    brightness: Floats
    sigma_px: Floats
    length_px: Floats
    angle: Floats
    areas: Indices
    rejected: int
    widest: int

    def __len__(self) -> int:
        """Number of stars."""
        return len(self.centroids)

    def of(self, chosen: Indices | Mask) -> "Spots":
        """Only the chosen ones."""
        return replace(
            self,
            centroids=self.centroids[chosen],
            brightness=self.brightness[chosen],
            sigma_px=self.sigma_px[chosen],
            length_px=self.length_px[chosen],
            angle=self.angle[chosen],
            areas=self.areas[chosen],
        )


def find_spots(
    picture: NDArray[np.uint8], regions: Regions, noise: float, sizes: tuple[int, int], meter: Meter
) -> Spots:
    """Stars among the regions of a picture (rows, columns) whose pixels have so much noise.

    ``sizes``: pixels of the smallest and the largest star.
    """
    count = regions.count
    areas = np.bincount(regions.labels, minlength=count)
    meter.charge(ram_read=len(regions.labels), i32_add=len(regions.labels))
    widest = int(areas.max()) if count else 0
    fits = (areas >= sizes[0]) & (areas <= sizes[1])
    pixels = np.flatnonzero(fits[regions.labels])
    names, labels = np.unique(regions.labels[pixels], return_inverse=True)
    rows, columns = regions.rows[pixels], regions.columns[pixels]
    left_out = count - len(names)
    if not len(names):
        empty = np.zeros(0, _F)
        return Spots(np.zeros((0, 2), _F), empty, empty, empty, empty, areas[:0], left_out, widest)
    grey = _without_hot(picture, rows, columns, noise, meter).astype(_F)
    box = _Boxes.of(rows, columns, labels, len(names))
    sky, lit = box.ring(picture, np.bincount(labels, grey) / areas[names], meter)
    weight = np.maximum(grey - sky[labels], _F(0))
    total = np.maximum(np.bincount(labels, weight), 1e-3).astype(_F)
    x, y = (columns - box.left[labels]).astype(_F), (rows - box.top[labels]).astype(_F)

    def mean(values: Floats) -> Floats:
        return (np.bincount(labels, weight * values) / total).astype(_F)

    across, down = mean(x), mean(y)
    x, y = x - across[labels], y - down[labels]
    xx, yy, xy = mean(x * x), mean(y * y), mean(x * y)
    full = np.bincount(labels, grey >= FULL)
    # Each pixel's noise moves the centroid by its distance; light has its own.
    lever = np.bincount(labels, (x * x + y * y) / 2 * _F(noise**2)) + SHOT * total * (xx + yy) / 2
    size = areas[names]
    faint = (noise * size / total) ** 2
    lever *= (CUT + CUT_AREA / size) * (1 + CUT_LEVEL * faint)
    floor = FLOOR_SHARE**2 * size * (1 + full / 25)
    sigma = np.sqrt(lever / total**2 + floor).astype(_F)
    apart = np.sqrt((xx - yy) ** 2 + 4 * xy**2)
    narrow = np.maximum((xx + yy - apart) / 2, _F(1 / 12))
    length = np.where(apart > (LONG_RATIO - 1) * narrow, np.sqrt(12 * apart), _F(0)).astype(_F)
    angle = (np.arctan2(2 * xy, xx - yy) / 2 % np.pi).astype(_F)
    light = len(pixels)
    meter.charge(pixel_read=light, i32_add=14 * light, i32_mul=9 * light, loop=light)
    found = len(names)
    meter.charge(f32_convert=8 * found, f32_div=10 * found, f32_sqrt=4 * found, f32_atan2=found)
    meter.charge(f32_mul=20 * found, f32_add=15 * found, f32_compare=4 * found, loop=found)
    stars = np.flatnonzero((lit <= MOST_LIT) & (total > 3 * noise))
    order = stars[np.argsort(-total[stars], kind="stable")]
    steps = len(order) * max(len(order), 1).bit_length()
    meter.charge(f32_compare=steps, ram_read=steps, ram_write=steps, loop=steps)
    centroids = np.stack([box.left + across, box.top + down], axis=1).astype(_F)
    left_out += found - len(order)
    return Spots(centroids, total, sigma, length, angle, size, left_out, widest).of(order)


def _without_hot(
    picture: NDArray[np.uint8], rows: Indices, columns: Indices, noise: float, meter: Meter
) -> NDArray[np.int32]:
    """Grey levels at (p,) pixels; where one is far above all but one neighbour, the third level."""
    padded = np.pad(picture, 1, mode="edge")
    near = np.stack(
        [
            padded[rows + dy, columns + dx]
            for dy in range(3)
            for dx in range(3)
            if (dy, dx) != (1, 1)
        ]
    )
    near = np.sort(near, axis=0).astype(np.int32)
    own = picture[rows, columns].astype(np.int32)
    second, middle = near[-2], (near[3] + near[4]) // 2
    meter.charge(pixel_read=8 * len(rows), i32_add=16 * len(rows), loop=8 * len(rows))
    hot = own - middle > 2 * (second - middle) + 6 * noise
    return np.where(hot, middle, own)


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Rectangles around regions: first and last rows and columns (n,)."""

    top: Indices
    bottom: Indices
    left: Indices
    right: Indices

    @classmethod
    def of(cls, rows: Indices, columns: Indices, labels: Indices, count: int) -> "_Boxes":
        """Of pixels (p,) whose regions are numbered 0 to count - 1."""
        far = 1 << 30
        top, left = np.full(count, far), np.full(count, far)
        bottom, right = np.zeros(count, np.intp), np.zeros(count, np.intp)
        np.minimum.at(top, labels, rows)
        np.minimum.at(left, labels, columns)
        np.maximum.at(bottom, labels, rows)
        np.maximum.at(right, labels, columns)
        return cls(top, bottom, left, right)

    def ring(
        self, picture: NDArray[np.uint8], means: NDArray[np.float64], meter: Meter
    ) -> tuple[Floats, Indices]:
        """Level of the sky around each region (n,), and how many places of its ring are lit.

        ``means``: (n,) of the regions' own grey levels.
        """
        turn = np.arange(RING) * (2 * np.pi / RING)
        middle_x, middle_y = (self.left + self.right) / 2, (self.top + self.bottom) / 2
        wide, high = (self.right - self.left) / 2 + GAP, (self.bottom - self.top) / 2 + GAP
        x = np.rint(middle_x[:, None] + wide[:, None] * np.cos(turn)).astype(np.intp)
        y = np.rint(middle_y[:, None] + high[:, None] * np.sin(turn)).astype(np.intp)
        x = np.clip(x, 1, picture.shape[1] - 2)
        y = np.clip(y, 1, picture.shape[0] - 2)
        nine = [picture[y + dy, x + dx].astype(_F) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
        # A spike in a place does not count: its second largest pixel ends it.
        places = np.sort(np.stack(nine), axis=0)[:8].mean(axis=0)
        sky = np.median(places, axis=1).astype(_F)
        steps = places.size
        meter.charge(pixel_read=9 * steps, i32_add=18 * steps, i32_mul=2 * steps, loop=10 * steps)
        meter.charge(i32_add=5 * steps, table_byte=5 * steps)
        lit = places - sky[:, None] > LIT * np.maximum(means[:, None] - sky[:, None], 1)
        return sky, lit.sum(axis=1)
