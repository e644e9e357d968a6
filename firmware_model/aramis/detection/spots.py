"""Which regions of a picture are stars, where they are, and how well that is known.

An extension: the thesis takes every region for a star (section 3.6). Here its shape decides: a star
is darker all around, so a ring about it shows limbs, edges and glare; it is no larger than stars
get; and where the others are round, one that is long is a track. A pixel that outshines its
neighbours more than any spot can is hot, and takes their level. The level under a star is that of
its ring, which a gradient does not move.

Motion during the exposure draws stars out. The second moments of a streak along and across differ
by the square of its length over twelve, as those of a line do, whatever the star's width. Streaks
of a turn are parallel, or around the boresight. Tracks of protons have all directions.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.aramis.field import CameraField

LARGEST = 10  #: regions looked at for motion
UPPER_QUARTILE = 75  #: of the lengths: long streaks fall apart, and their pieces are shorter
FEWEST_LONG = 3  #: streaks that show a motion; at least half of the brightest spots must be any

#: Streaks times the square of the length of the mean of their directions, doubled, as unit vectors:
#: chance exceeds it once in thirteen.
ALIGNED = 2.6

TRACK_PX = 6.0  #: beside stars at rest, what is longer is a track

RING = 16  #: places around a region where the sky is looked at, each the mean of 3 x 3 pixels
GAP = 3  #: pixels between a region and the middle of its ring's places

#: Fraction of the way from the sky to the region's mean above which a place of the ring is lit.
LIT = 0.3

MOST_LIT = 4  #: places of a star's ring that may be lit, by its neighbours

#: Variance of a pixel in counts squared that each count of light brings: that of 8 electrons.
SHOT = 0.12

#: Error of a centroid that light does not explain, pixels and faint neighbours, as a share of the
#: root of its area (measured).
FLOOR_SHARE = 0.006

#: Where a spot is cut off depends on its noise too, which adds variance, the more so the smaller
#: and fainter it is: measured over spots of 1.5 to 6 px, levels of 2 to 200 counts and gradients.
CUT, CUT_AREA, CUT_LEVEL = 1.8, 60.0, 4.0

FULL = 250  #: counts from which a pixel is full, and its region's centroid less sure

LONG_RATIO = 2.5  #: of the moments along and across, from which on a region is long

_F = np.float32


@dataclass(frozen=True, eq=False)
class StarSpots:
    """Stars of a picture, the brightest first, and what was left out."""

    centroids: Floats  #: (n, 2) x and y in px
    brightness: Floats  #: (n,) counts above the sky
    sigma_px: Floats  #: (n,) expected error of the centroids, each axis
    length_px: Floats  #: (n,) of the streak that motion could have made of it
    angle: Floats  #: (n,) direction of that streak, 0 to pi
    areas: Indices  #: (n,) pixels of them
    rejected: int  #: regions that are no stars by their shape
    widest: int  #: pixels of the largest region

    def __len__(self) -> int:
        return len(self.centroids)

    def of(self, chosen: Indices | Mask) -> "StarSpots":
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
    picture: NDArray[np.uint8], regions: Regions, noise: float, sizes: tuple[int, int]
) -> StarSpots:
    """Stars among the regions of a picture (rows, columns); ``noise`` of a pixel in counts.

    ``sizes``: pixels of the smallest and the largest star.
    """
    chosen = regions.only((regions.sizes >= sizes[0]) & (regions.sizes <= sizes[1]))
    labels, size, count = chosen.labels, chosen.sizes, chosen.count
    grey = _without_hot(picture, chosen, noise).astype(_F)
    sky, lit = _ring(picture, chosen, np.bincount(labels, grey, count) / size)
    weight = np.maximum(grey - sky[labels], _F(0))
    found = chosen.moments(weight, 1e-3)
    total = found.light
    x, y = chosen.columns - found.x[labels], chosen.rows - found.y[labels]
    # Each pixel's noise moves the centroid by its distance; light has its own.
    light_lever = SHOT * total * (found.xx + found.yy) / 2
    lever = np.bincount(labels, (x * x + y * y) / 2 * noise**2, count) + light_lever
    lever *= (CUT + CUT_AREA / size) * (1 + CUT_LEVEL * (noise * size / total) ** 2)
    full = np.bincount(labels, grey >= FULL, count)
    sigma = np.sqrt(lever / total**2 + FLOOR_SHARE**2 * size * (1 + full / 25))
    is_long = found.spread > (LONG_RATIO - 1) * np.maximum(found.across, 1 / 12)
    length = np.where(is_long, np.sqrt(12 * found.spread), 0)
    stars = np.flatnonzero((lit <= MOST_LIT) & (total > 3 * noise))
    order = stars[np.argsort(-total[stars], kind="stable")]
    return StarSpots(
        np.stack([found.x, found.y], axis=1).astype(_F),
        total.astype(_F),
        sigma.astype(_F),
        length.astype(_F),
        (found.doubled_angle / 2 % np.pi).astype(_F),
        size,
        regions.count - len(order),
        int(regions.sizes.max(initial=0)),
    ).of(order)


def _without_hot(picture: NDArray[np.uint8], regions: Regions, noise: float) -> NDArray[np.int32]:
    """Grey levels at the regions' pixels; where one is far above all but one neighbour, the third
    level."""
    rows, columns = regions.rows, regions.columns
    padded = np.pad(picture, 1, mode="edge")
    around = [(dy, dx) for dy in range(3) for dx in range(3) if (dy, dx) != (1, 1)]
    near = np.stack([padded[rows + dy, columns + dx] for dy, dx in around])
    near = np.sort(near, axis=0).astype(np.int32)
    own = picture[rows, columns].astype(np.int32)
    second, middle = near[-2], (near[3] + near[4]) // 2
    hot = own - middle > 2 * (second - middle) + 6 * noise
    return np.where(hot, middle, own)


def _ring(
    picture: NDArray[np.uint8], regions: Regions, means: NDArray[np.float64]
) -> tuple[Floats, Indices]:
    """Level of the sky around each region (n,), and the lit places of its ring; ``means``: (n,) of
    the regions' own grey levels."""
    turn = np.arange(RING) * (2 * np.pi / RING)
    top, left, bottom, right = regions.box
    wide, high = (right - left) / 2 + GAP, (bottom - top) / 2 + GAP
    x = np.rint(((left + right) / 2)[:, None] + wide[:, None] * np.cos(turn)).astype(np.intp)
    y = np.rint(((top + bottom) / 2)[:, None] + high[:, None] * np.sin(turn)).astype(np.intp)
    x = np.clip(x, 1, picture.shape[1] - 2)
    y = np.clip(y, 1, picture.shape[0] - 2)
    nine = [picture[y + dy, x + dx].astype(_F) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    # A spike in a place does not count: its second largest pixel ends it.
    places = np.sort(np.stack(nine), axis=0)[:8].mean(axis=0)
    sky = np.median(places, axis=1).astype(_F)
    lit = places - sky[:, None] > LIT * np.maximum(means[:, None] - sky[:, None], 1)
    return sky, lit.sum(axis=1)


def smear_px(picture: NDArray[np.uint8], regions: Regions, floor: int) -> float:
    """Upper quartile of the lengths of the largest regions, weighted by grey levels above `floor`;
    0 without regions."""
    if not regions.count:
        return 0.0
    grey = picture[regions.rows, regions.columns].astype(np.float32)
    moments = regions.moments(np.maximum(grey - np.float32(floor), 1), 1.0)
    largest = np.argsort(-regions.sizes, kind="stable")[:LARGEST]
    return float(np.percentile(np.sqrt(12 * moments.spread[largest]), UPPER_QUARTILE))


def without_tracks(spots: StarSpots, field: CameraField) -> tuple[StarSpots, float]:
    """StarSpots without tracks, and how far motion drew the stars out, in px: 0 at rest."""
    bright = spots.length_px[: 2 * LARGEST]
    long = np.flatnonzero(bright > 0)
    places = spots.centroids[long] - np.array(field.centre, np.float32)
    around = np.arctan2(places[:, 1], places[:, 0])
    angles, count = 2 * spots.angle[long], len(long)
    aligned = max(_mean_length(angles), _mean_length(angles - 2 * around))
    many = count >= max(FEWEST_LONG, len(bright) / 2)
    if many and count * aligned**2 > ALIGNED:
        return spots, float(np.percentile(bright, UPPER_QUARTILE))
    return spots.of(spots.length_px <= TRACK_PX), 0.0


def _mean_length(angles: Floats) -> float:
    """Length of the mean of unit vectors with those angles, 0 without any."""
    return float(np.hypot(np.cos(angles).mean(), np.sin(angles).mean())) if len(angles) else 0.0
