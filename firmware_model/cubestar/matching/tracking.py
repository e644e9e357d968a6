"""Tracking: centroids are the stars that the last attitude predicts nearest to them.

CubeStar thesis, section 4.5. No voting: the stars near the last boresight are turned into camera
axes with the last attitude, and a centroid within 0.3 deg of one takes its identity, so the camera
may turn up to 0.3 deg in an iteration and two stars are enough. Assumed: the nearest star is taken
when several are in reach. An extension: a verification round drops what contradicts the other
stars, as when a star fainter than the catalogue stands near the predicted place of another.
"""

from math import radians, sin

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    NONE,
    CentroidPairs,
    Identification,
    MatchOutcome,
    unidentified,
    verify,
)
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, DEFAULT_MARGIN_RAD
from cubestack.firmware_model.mcu.costs import Meter

#: Largest angle between a centroid and its star's predicted direction, in degrees.
REACH_DEG = 0.3

#: Stars that a solution needs when the attitude is known roughly.
FEWEST_STARS = 2


def track(
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    attitude: NDArray[np.float32],
    meter: Meter,
    *,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    verified: bool = True,
    radius_deg: float = CUT_RADIUS_DEG,
) -> Identification:
    """Identify centroids from the attitude of the iteration before.

    Phases: `reduction`, `prediction` and, if verified, `distances`, `verification`.

    Args:
        directions: (n, 3) unit vectors of the centroids in camera axes.
        attitude: (3, 3) direction cosine matrix, inertial to camera, of the last solution.
        margin_rad: largest difference between a measured and a catalogue angle, in rad.
        verified: whether the verification round follows; without it all stars weigh the same.
        radius_deg: of the reduced catalogue, about the boresight.
    """
    count = len(directions)
    if count < FEWEST_STARS:
        return unidentified(count, MatchOutcome.TOO_FEW_CENTROIDS)
    with meter.phase("reduction"):
        stars = catalogue.near(attitude[2], radius_deg, meter)
    with meter.phase("prediction"):
        kept = _nearest(directions, catalogue.vectors, stars, attitude, meter)
    votes = (kept != NONE).astype(np.uint8)
    if verified:
        with meter.phase("distances"):
            pairs = CentroidPairs.measure(directions, meter)
        with meter.phase("verification"):
            votes, kept = verify(pairs, kept, catalogue.vectors, margin_rad, meter)
    if np.count_nonzero(kept != NONE) < FEWEST_STARS:
        return Identification(np.full_like(kept, NONE), votes, MatchOutcome.TOO_FEW_MATCHED)
    return Identification(kept, votes, MatchOutcome.IDENTIFIED)


def _nearest(
    directions: NDArray[np.float32],
    vectors: NDArray[np.float32],
    stars: NDArray[np.uint16],
    attitude: NDArray[np.float32],
    meter: Meter,
) -> NDArray[np.int32]:
    """Star among `stars` (k,) predicted nearest to each centroid (n, 3), -1 when out of reach.

    Compared by the square of the chord, which single precision resolves better than a cosine.
    """
    count, candidates = len(directions), len(stars)
    compared = count * candidates
    meter.charge(
        flash_read=3 * candidates,
        f32_mul=9 * candidates + 3 * compared,
        f32_add=6 * candidates + 5 * compared,
        f32_compare=compared,
        loop=candidates + compared,
    )
    if candidates == 0:
        return np.full(count, NONE, dtype=np.int32)
    predicted = turned(vectors[stars], attitude.astype(np.float32))
    apart = directions[:, None, :] - predicted[None, :, :]
    chord2 = apart[..., 0] ** 2 + apart[..., 1] ** 2 + apart[..., 2] ** 2
    nearest = np.argmin(chord2, axis=1)
    reach2 = np.float32((2 * sin(radians(REACH_DEG) / 2)) ** 2)
    in_reach = chord2[np.arange(count), nearest] <= reach2
    return np.where(in_reach, stars[nearest].astype(np.int32), np.int32(NONE))
