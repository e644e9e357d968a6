"""Tracking: a centroid is the star that the last attitude predicts nearest to it.

CubeStar thesis, section 4.5. The stars near the last boresight are rotated into camera axes with
the last attitude, and a centroid within 0.3 deg of one takes its identity, so the camera may turn
by 0.3 deg in an iteration, and two stars are enough. Assumed: the nearest of several stars in
reach.

An extension: pictures more than a second apart widen the reach, up to twice, so that a camera that
turns by 0.3 deg/s is followed; the verification round drops what contradicts the other stars; the
rest corrects the attitude, which is confirmed like one that a triangle proposes
(``star_tracker.observation``). Expected wrong attitudes are pairs of wrong stars: F^2 / 2 for F
centroids in reach of a predicted star by chance, times the part whose sides agree, the margin over
the reach. So neither a camera that looks elsewhere nor a wrong last attitude is accepted.
"""

from math import radians, sin

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.field_of_view import FieldOfView
from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    NONE,
    CentroidPairs,
    Identification,
    identified,
    unidentified,
    verify,
)
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, DEFAULT_MARGIN_RAD
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import by_chance, correction
from cubestack.firmware_model.star_tracker.observation import (
    LARGEST_FALSE_ALARM,
    LEVELS,
    Observation,
)
from cubestack.firmware_model.star_tracker.search import MatchOutcome

#: Largest angle between a centroid and its star's predicted direction, in degrees.
REACH_DEG = 0.3

#: Time between two pictures in s up to which the reach grows with it.
LONGEST_S = 2.0

#: Stars that a solution needs when the attitude is known roughly.
FEWEST_STARS = 2


def track(
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    attitude: NDArray[np.float32],
    meter: Meter,
    *,
    field: FieldOfView | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    radius_deg: float = CUT_RADIUS_DEG,
    apart_s: float = 1.0,
) -> Identification:
    """Identify centroids of unit vectors (n, 3) from the attitude of the iteration before.

    Phases: `reduction`, `prediction` and, if verified, `distances`, `verification`.

    Args:
        attitude: (3, 3) direction cosine matrix, inertial to camera, of the last solution.
        field: for the verification; None does not verify, and all stars weigh the same.
        margin_rad: largest difference between a measured and a catalogue angle, in rad.
        radius_deg: of the reduced catalogue, about the boresight.
        apart_s: time since the picture of the last attitude; counts if verified.
    """
    count = len(directions)
    if count < FEWEST_STARS:
        return unidentified(count, MatchOutcome.TOO_FEW_CENTROIDS)
    with meter.phase("reduction"):
        stars = catalogue.near(attitude[2], radius_deg, meter)
    reach = radians(REACH_DEG)
    if field is not None:
        reach *= min(max(apart_s, 1.0), LONGEST_S)
    with meter.phase("prediction"):
        kept = _nearest(directions, catalogue.vectors, stars, attitude, reach, meter)
    votes = (kept != NONE).astype(np.uint8)
    if field is not None:
        with meter.phase("distances"):
            pairs = CentroidPairs.measure(directions, meter)
        with meter.phase("verification"):
            votes, kept = verify(pairs, kept, catalogue.vectors, margin_rad, meter, thinned=True)
    if np.count_nonzero(kept != NONE) < FEWEST_STARS:
        return Identification(np.full_like(kept, NONE), votes, MatchOutcome.TOO_FEW_MATCHED)
    if field is None:
        return Identification(kept, votes, MatchOutcome.IDENTIFIED)
    with meter.phase("verification"):
        return _confirmed(
            Observation(directions, catalogue, field, margin_rad, meter), attitude, kept, reach
        )


def _confirmed(
    picture: Observation, attitude: NDArray[np.float32], kept: NDArray[np.int32], reach: float
) -> Identification:
    """The identification that an attitude gives, corrected by the stars (n,) that agree; ``reach``
    in rad."""
    meter, named = picture.meter, np.flatnonzero(kept != NONE)
    places = turned(picture.stars.vectors[kept[named]], attitude)
    turn, _ = correction(picture.directions[named], places, meter, with_scale=False)
    rotation = (turn @ attitude).astype(np.float32)
    expected = len(picture.stars.vectors) / (4 * np.pi) * picture.view.solid_angle_sr
    astray = expected * by_chance(len(kept), reach, picture.view.solid_angle_sr)
    tries = len(LEVELS) * astray**2 / 2 * min(picture.margin_rad / reach, 1.0)
    meter.charge(f32_mul=9 * len(named) + 34, f32_add=6 * len(named) + 18, f32_div=1)
    found = picture.confirm(rotation, FEWEST_STARS, tries)
    if found.false_alarm > LARGEST_FALSE_ALARM:
        return unidentified(len(kept), MatchOutcome.UNCONFIRMED)
    return identified(found.centroids, found, len(kept))


def _nearest(
    directions: NDArray[np.float32],
    vectors: NDArray[np.float32],
    stars: NDArray[np.uint16],
    attitude: NDArray[np.float32],
    reach: float,
    meter: Meter,
) -> NDArray[np.int32]:
    """Star among `stars` (k,) predicted nearest to each centroid (n, 3), -1 when out of ``reach``
    in rad; by squares of chords, which single precision resolves better than cosines."""
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
    reach2 = np.float32((2 * sin(reach / 2)) ** 2)
    in_reach = chord2[np.arange(count), nearest] <= reach2
    return np.where(in_reach, stars[nearest].astype(np.int32), np.int32(NONE))
