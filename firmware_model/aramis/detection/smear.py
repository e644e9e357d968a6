"""How far the stars were drawn out while the picture was taken. An extension: the thesis has none.

A star that moves during the exposure leaves a streak. Its second moments along and across differ by
the square of the streak's length over twelve, as those of a line do, whatever the star's own width.
Streaks of a turn lie the same way: along one direction, or around the boresight. Tracks of protons
lie in all directions; they are no stars.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.aramis.detection.spots import Spots
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.mcu.costs import Meter

LARGEST = 10
"""Regions looked at."""

UPPER_QUARTILE = 75
"""Of the lengths: long streaks fall apart, and their pieces are shorter."""

FEWEST_LONG = 3
"""Streaks that tell a motion; at least half of the brightest spots must be any."""

ALIGNED = 2.6
"""Streaks times the square of the length of the mean of their directions, doubled, as unit vectors:
chance exceeds it once in thirteen."""

TRACK_PX = 6.0
"""Beside stars at rest, what is longer is a track."""


def smear_px(picture: NDArray[np.uint8], regions: Regions, floor: int, meter: Meter) -> float:
    """Upper quartile of the lengths of the largest regions, weighed by grey levels above `floor`.

    0 without regions.
    """
    grey = picture[regions.rows, regions.columns].astype(np.float32)
    lengths = _lengths(regions, np.maximum(grey - np.float32(floor), 1), meter)
    return float(np.percentile(lengths, UPPER_QUARTILE)) if lengths else 0.0


def without_tracks(spots: Spots, field: Field, meter: Meter) -> tuple[Spots, float]:
    """Spots without tracks, and how far motion drew the stars out, in px: 0 at rest."""
    bright = spots.length_px[: 2 * LARGEST]
    long = np.flatnonzero(bright > 0)
    places = spots.centroids[long] - np.array(field.centre, np.float32)
    around = np.arctan2(places[:, 1], places[:, 0])
    angles = 2 * spots.angle[long]
    count = len(long)
    meter.charge(f32_sin=4 * count, f32_atan2=count, f32_add=6 * count, f32_sqrt=2)
    aligned = max(_mean_length(angles), _mean_length(angles - 2 * around))
    many = count >= max(FEWEST_LONG, len(bright) / 2)
    if many and count * aligned**2 > ALIGNED:
        return spots, float(np.percentile(bright, UPPER_QUARTILE))
    return spots.of(spots.length_px <= TRACK_PX), 0.0


def _mean_length(angles: Floats) -> float:
    """Length of the mean of unit vectors with those angles, 0 without any."""
    return float(np.hypot(np.cos(angles).mean(), np.sin(angles).mean())) if len(angles) else 0.0


def _lengths(regions: Regions, weights: Floats, meter: Meter) -> list[float]:
    """Of the largest regions."""
    sizes = np.bincount(regions.labels, minlength=regions.count)
    lengths = []
    for region in np.argsort(-sizes, kind="stable")[:LARGEST]:
        pixels = np.flatnonzero(regions.labels == region)
        lengths.append(_length(regions.rows[pixels], regions.columns[pixels], weights[pixels]))
        count = len(pixels)
        meter.charge(ram_read=3 * count, f32_convert=3 * count, f32_div=5, f32_sqrt=2)
        meter.charge(f32_mul=8 * count, f32_add=6 * count, loop=count)
    meter.charge(i32_add=len(regions.labels), loop=len(regions.labels) + LARGEST * regions.count)
    return lengths


def _length(rows: Indices, columns: Indices, weights: Floats) -> float:
    """Length of the streak that pixels (n,) with weights make."""
    y, x = (rows - rows[0]).astype(np.float32), (columns - columns[0]).astype(np.float32)
    total = weights.sum()
    x, y = x - (weights @ x) / total, y - (weights @ y) / total
    across, down = weights @ (x * x) / total, weights @ (y * y) / total
    mixed = weights @ (x * y) / total
    return float(np.sqrt(12 * np.sqrt((across - down) ** 2 + 4 * mixed**2)))
