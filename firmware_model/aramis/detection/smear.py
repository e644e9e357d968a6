"""How far motion drew the stars out during the exposure.

An extension: the thesis has none. The second moments of a streak along and across differ by the
square of its length over twelve, as those of a line do, whatever the star's width. Streaks of a
turn are parallel, or around the boresight. Tracks of protons have all directions and are no stars.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.aramis.detection.spots import StarSpots
from cubestack.firmware_model.aramis.field import CameraField

LARGEST = 10  #: regions looked at
UPPER_QUARTILE = 75  #: of the lengths: long streaks fall apart, and their pieces are shorter
FEWEST_LONG = 3  #: streaks that show a motion; at least half of the brightest spots must be any

#: Streaks times the square of the length of the mean of their directions, doubled, as unit vectors:
#: chance exceeds it once in thirteen.
ALIGNED = 2.6

TRACK_PX = 6.0  #: beside stars at rest, what is longer is a track


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
