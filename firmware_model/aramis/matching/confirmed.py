"""Attitudes that further stars confirm, within the time limit.

An extension: the AraMiS thesis accepts every unique triangle, and many of its results are wrong
(section 8.2). Here triples propose attitudes (``triple_triangles``) to the search that all star
trackers share (``star_tracker.search``). The accepted one is corrected to the middle row's time
where stars moved, fitted to its stars, and refused where its angles are too uncertain.
"""

from dataclasses import replace
from math import sqrt

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.shutter import FEWEST, at_middle_row
from cubestack.firmware_model.aramis.matching.triple_triangles import TripleTriangles
from cubestack.firmware_model.aramis.solution import NONE, Profile, Solution, StarList, unsolved
from cubestack.firmware_model.attitude.geometry import scaled, turned
from cubestack.firmware_model.attitude.lens_doubt import judge_lens
from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import OTHER_SCALE, Candidate, Observation
from cubestack.firmware_model.star_tracker.quality import Rating
from cubestack.firmware_model.star_tracker.search import AttitudeSearch, MatchOutcome

FEWEST_STARS = 4

#: Parts of the profile's tolerance within which stars may agree: 0.5, 1.3 and 3.3 px by default.
LEVELS = (0.15, 0.4, 1.0)

SCALES = 30  #: attitudes that count for one whose focal length was changed
MOVED = 1.0  #: error of stars that were moved to the middle row, as a share of their way (chosen)

#: Error of a real lens beside the model, which triples must bear (measured with real pictures).
LENS_PX = 0.1

FLOOR_PX = 0.01  #: error of a star's place beside its centroid's: catalogue (assumed)

#: Weight of residuals beyond ``BEYOND`` declared variances, which are rare by chance: chosen so
#: that the claimed sigmas hold with lens residuals, which move neighbouring stars alike.
EXCESS, BEYOND = 4.0, 2.0


def identify_confirmed(
    measured: StarList,
    field: CameraField,
    profile: Profile,
    database: Database,
    hint: Floats | None,
    meter: Meter,
    until: float,
) -> Solution:
    """Identify measured stars, the brightest first; see ``identification.identify``."""
    sigma_px = measured.sigma_px
    if sigma_px is None:
        sigma_px = np.full(len(measured), profile.sigma_rad / field.scale[1], np.float32)
    if len(measured) < FEWEST_STARS:
        smeared = measured.smear_px > profile.smear_px
        return unsolved(Reason.SMEAR if smeared else Reason.TOO_FEW_STARS, measured)
    directions = field.directions(measured.centroids, meter)
    stars = DatabaseStars(database.vectors)
    picture = Observation(directions, stars, field, profile.tolerance_rad, meter, LEVELS, SCALES)
    sigma_rad = (np.hypot(sigma_px, LENS_PX) * field.scale[1]).astype(np.float32)
    triples = TripleTriangles(picture, measured.centroids, sigma_rad, field, database)
    if hint is not None:
        triples.aim(hint, profile.hint_tolerance_deg)
    search = AttitudeSearch(until, profile.largest_chance, profile.largest_chance, FEWEST_STARS)
    found = search.run(triples.passes(FEWEST_STARS))
    if isinstance(found, Candidate):
        with meter.phase("attitude"):
            solution = _solution(found, measured, sigma_px, picture, field, profile)
    else:
        reason = Reason.UNCONFIRMED if triples.matches else Reason.NO_TRIANGLE
        if found is MatchOutcome.NO_TIME:
            reason = Reason.NO_TIME
        solution = unsolved(reason, measured, candidates=min(triples.matches, 0xFFFF))
    solution = replace(solution, triples=triples.triples)
    if solution.outcome is MeasurementOutcome.NONE and _is_drawn_out(measured, field, profile):
        return replace(solution, reason=Reason.SMEAR)
    return solution


def _is_drawn_out(measured: StarList, field: CameraField, profile: Profile) -> bool:
    """Whether motion explains that the stars are not at their places: between the first row and the
    last, or as pieces of streaks, they moved farther than the tolerance."""
    pieces_px = measured.smear_px / sqrt(12)  # standard deviation of a place on a streak
    reach_px = profile.tolerance_rad / field.scale[1]
    return measured.smear_px > profile.smear_px and max(measured.skew_px, pieces_px) > reach_px


def _solution(
    found: Candidate,
    measured: StarList,
    sigma_px: Floats,
    picture: Observation,
    field: CameraField,
    profile: Profile,
) -> Solution:
    """Fit a confirmed attitude, or refuse it where its angles are too uncertain."""
    meter, named = picture.meter, found.centroids
    expected = found.expected
    sigmas = np.sqrt(sigma_px[named] ** 2 + FLOOR_PX**2) * np.float32(field.scale[1])
    meter.charge(f32_mul=2 * len(named), f32_add=len(named), f32_sqrt=len(named))
    as_seen = picture.directions[named]
    placed = _at_middle_row(found, as_seen, sigmas, measured, picture, field, profile)
    if placed is None:
        return unsolved(Reason.SMEAR, measured, expected=expected)
    vectors, sigmas = placed
    try:
        fit = robust_fit(
            vectors,
            picture.stars.vectors[found.stars],
            sigmas,
            meter,
            scale=1.0,
            excess=EXCESS,
            beyond=BEYOND,
        )
    except AttitudeError:
        return unsolved(Reason.UNCONFIRMED, measured, expected=expected)
    if fit.covariance[2, 2] > profile.largest_sigma_rad**2:
        return unsolved(Reason.UNCONFIRMED, measured, expected=expected)
    if vectors is as_seen:  # else their motion explains residuals
        lens = judge_lens(
            measured.centroids[named],
            picture.stars.vectors[found.stars],
            sigmas,
            lambda pixels: field.directions(pixels, meter),
            field.centre,
            field.scale[1],
            fit,
            meter,
            field.tolerance if profile.judge_lens else None,
        )
        if lens.is_refused:
            return unsolved(Reason.LENS, measured, expected=expected)
        fit = replace(fit, quaternion=lens.quaternion, covariance=lens.covariance)
    rating = Rating.of(fit, found.false_alarm, meter)
    stars = np.full(len(measured), NONE, dtype=np.int32)
    stars[named] = found.stars
    return Solution(
        MeasurementOutcome.CONCLUSIVE,
        Reason.CONFIRMED,
        fit.quaternion,
        stars,
        measured,
        candidates=1,
        expected=expected,
        rating=rating,
    )


def _at_middle_row(
    found: Candidate,
    vectors: Floats,
    sigmas: Floats,
    measured: StarList,
    picture: Observation,
    field: CameraField,
    profile: Profile,
) -> tuple[Floats, Floats] | None:
    """Directions (k, 3) of the stars at one instant and their errors (k,) in rad, ``vectors`` and
    ``sigmas`` where they did not move; None where the turn about the boresight is too uncertain."""
    named, meter = found.centroids, picture.meter
    still = measured.smear_px <= profile.smear_px or measured.skew_px <= 0
    if still or len(named) < FEWEST:
        return vectors, sigmas
    factor = found.factor if abs(found.factor - 1) > OTHER_SCALE else 1.0
    vectors = scaled(vectors, factor, meter)
    heights = measured.centroids[named, 1] / np.float32(field.rows) - np.float32(0.5)
    predicted = turned(picture.stars.vectors[found.stars], found.rotation)
    meter.charge(f32_mul=9 * len(named), f32_add=6 * len(named), loop=len(named))
    straight, weights, sigma_rad = at_middle_row(
        vectors, predicted, heights, measured.skew_px * field.scale[1], meter
    )
    if sigma_rad > profile.motion_sigma_rad and measured.skew_px > profile.moved_px:
        return None
    moved = MOVED * np.sqrt(np.mean(np.sum((straight - vectors) ** 2, axis=1)))
    meter.charge(f32_mul=5 * len(named), f32_add=6 * len(named), f32_div=len(named))
    meter.charge(f32_sqrt=2 * len(named) + 1)
    sigmas = (np.hypot(sigmas, moved) / np.sqrt(weights)).astype(np.float32)
    return scaled(straight, 1 / factor, meter), sigmas


class DatabaseStars:
    """Stars of the database, looked through with one product of integers each."""

    def __init__(self, vectors: Floats) -> None:
        self.vectors = vectors

    def within(self, boresight: Floats, least: np.float32, meter: Meter) -> Indices:
        count = len(self.vectors)
        meter.charge(ram_read=3 * count // 2, i32_mul=3 * count, i32_add=3 * count, loop=count)
        return np.flatnonzero(self.vectors @ boresight >= np.float32(least))
