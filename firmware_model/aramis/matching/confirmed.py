"""From measured stars to an attitude that further stars confirm, within the time there is.

An extension: the AraMiS thesis believes every unique triangle, and many of its results are wrong
(section 8.2). Here triples are tried one after the other. An attitude that puts a further star
where one was measured is refined with all stars that agree, and with the focal length that suits
them best; it is believed when few wrong attitudes would be confirmed as well as it, and when the
stars leave little doubt about its angles.
"""

from dataclasses import dataclass, replace

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.matching.eigenvalue import largest_eigenvalue
from cubestack.firmware_model.aramis.matching.shutter import FEWEST, at_middle_row
from cubestack.firmware_model.aramis.matching.triple_search import Hypothesis, TripleSearch
from cubestack.firmware_model.aramis.solution import (
    NONE,
    Profile,
    Quality,
    Solution,
    StarList,
    unsolved,
)
from cubestack.firmware_model.attitude import confirmation
from cubestack.firmware_model.attitude.covariance import covariance
from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter

NEAREST_PX = 0.5
"""A star within so many pixels of its place agrees however sure both are."""

REACH_SIGMAS = 4.0
"""Else it agrees within so many of the typical star's errors."""

REACH_LEFT = 2.0
"""Or within so many root mean square distances: a lens that is not modelled well."""

SCALES = 30
"""Attitudes that count for one whose focal length was fitted: it can be any."""

LARGEST_SCALE = 0.04
"""Change of the focal length; more is another lens."""

SCALE_RAD = 2e-4
"""Move of a star at the edge of the field from which on a change of focal length is believed."""

ROUNDS = 4
"""Of finding the stars that agree, and solving with them."""

FEWEST_STARS = 4

FLOOR_RAD, FLOOR_ROLL_RAD = 1e-6, 1e-5
"""Of the attitude's angles across and about the boresight: pixels, single precision (assumed)."""

LENS_PX = 0.1
"""Error of a real lens beside the model, which triples must bear (measured with real pictures)."""

FLOOR_PX = 0.01
"""Error of a star's place beside its centroid's: catalogue (assumed)."""

EXCESS, BEYOND = 4.0, 2.0
"""How much residuals count beyond so many declared variances, which chance seldom gives: chosen so
that the claimed sigmas hold with lens residuals, which move neighbouring stars alike."""


@dataclass(frozen=True, eq=False)
class Fit:
    """An attitude of all stars that agree with it.

    Attributes:
        quaternion: (4,) inertial to camera, scalar last.
        vectors: (k, 3) measured directions, with the fitted focal length.
        measured, stars: (k,) measured stars, and those of the database.
        expected: catalogue stars that it puts into the field.
        false_alarm: wrong attitudes to be expected that would be confirmed as well.
        scale: focal length beside the field's.
        residual_rad: root mean square of the stars' residuals in each axis.
    """

    quaternion: Floats
    vectors: Floats
    measured: Indices
    stars: Indices
    expected: int
    false_alarm: float
    scale: float
    residual_rad: float


def identify_surely(
    measured: StarList,
    field: Field,
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
    smeared = measured.smear_px > profile.smear_px
    if smeared and measured.skew_px > profile.skew_px:
        return unsolved(Reason.SMEAR, measured)
    if len(measured) < FEWEST_STARS:
        return unsolved(Reason.SMEAR if smeared else Reason.TOO_FEW_STARS, measured)
    vectors = field.directions(measured.centroids, meter)
    solution = _Search(
        measured, vectors, sigma_px, field, profile, database, hint, meter, until
    ).run()
    if smeared and solution.outcome is MeasurementOutcome.NONE:
        return replace(solution, reason=Reason.SMEAR)
    return solution


@dataclass
class _Search:
    """One picture's identification with confirmation.

    Attributes:
        vectors, sigma_px: (n, 3) directions of the measured stars, (n,) errors in px, each axis.
        hint: (3,) rough unit vector of the boresight; None: lost in space.
        until: cycles of the meter at which time is over.
    """

    measured: StarList
    vectors: Floats
    sigma_px: Floats
    field: Field
    profile: Profile
    database: Database
    hint: Floats | None
    meter: Meter
    until: float

    def run(self) -> Solution:
        """Triples until the attitude of one is confirmed, or time is over."""
        search = self._search()
        for found in search.run(FEWEST_STARS):
            if self.meter.total > self.until:
                return self._unsolved(Reason.NO_TIME, search)
            if found is None or self._far_from_hint(found.turn):
                continue
            fit = self._fit(found)
            if fit is None or fit.false_alarm > self.profile.largest_chance:
                continue
            return self._solution(fit, search)
        return self._unsolved(Reason.UNCONFIRMED if search.matches else Reason.NO_TRIANGLE, search)

    def _search(self) -> TripleSearch:
        faces = None
        if self.hint is not None:
            with self.meter.phase("faces"):
                faces = self.database.sphere.around(self.hint, self.meter)
        return TripleSearch(
            self.vectors,
            self.measured.centroids,
            (np.hypot(self.sigma_px, LENS_PX) * self.field.scale[1]).astype(np.float32),
            self.field,
            self.database,
            self.profile.tolerance_rad / self.field.scale[1],
            faces,
            self.meter,
        )

    def _far_from_hint(self, turn: Floats) -> bool:
        if self.hint is None:
            return False
        self.meter.charge(f32_mul=3, f32_add=2, f32_compare=1)
        limit = np.cos(np.radians(self.profile.hint_tolerance_deg))
        return not np.dot(turn[2], self.hint.astype(np.float32)) >= np.float32(limit)

    def _fit(self, found: Hypothesis) -> Fit | None:
        """The attitude of all stars that agree with a hypothesis; None when they are too few."""
        turn, scale = found.turn, found.scale
        vectors = confirmation.scaled(self.vectors, 1 / scale, self.meter)
        reach_rad = self.profile.tolerance_rad
        with self.meter.phase("verification"):
            for _ in range(ROUNDS):
                seen = in_field(self.database.vectors, turn, self.field, self.meter)
                predicted = turned(self.database.vectors[seen], turn)
                measured, rows, apart = confirmation.matched(
                    vectors, predicted, reach_rad, self.meter
                )
                if len(measured) < FEWEST_STARS:
                    return None
                refined = self._weighted(vectors[measured], measured, seen[rows])
                if refined is None:
                    return None
                quaternion, turn = refined, dcm(refined, self.meter)
                scale = self._scale(turn, measured, seen[rows])
                if abs(scale - 1) > LARGEST_SCALE:
                    return None
                vectors = confirmation.scaled(self.vectors, 1 / scale, self.meter)
                reach_rad = self._reach(measured, apart)
            seen = in_field(self.database.vectors, turn, self.field, self.meter)
            predicted = turned(self.database.vectors[seen], turn)
            measured, rows, apart = confirmation.matched(vectors, predicted, reach_rad, self.meter)
            if len(measured) < FEWEST_STARS:
                return None
            chance = confirmation.by_chance(len(vectors) - 3, reach_rad, self.field.solid_angle_sr)
            tried = found.by_chance * (SCALES if scale != 1.0 else 1)
            expected = len(seen)
            alarms = confirmation.false_alarm(
                tried, max(expected - 3, 0), len(measured) - 3, chance, self.meter
            )
        residual_rad = float(np.sqrt(np.mean(apart * apart) / 2))
        stars = seen[rows]
        return Fit(
            quaternion, vectors[measured], measured, stars, expected, alarms, scale, residual_rad
        )

    def _reach(self, measured: Indices, apart: Floats) -> float:
        """Within it stars agree, by expected errors and distances (k,) of those that already do."""
        count, pixel = len(measured), self.field.scale[1]
        typical = float(np.sqrt(np.mean(self.sigma_px[measured] ** 2)))
        left = float(np.sqrt(np.mean(apart * apart)))
        self.meter.charge(f32_mul=2 * count, f32_add=2 * count, f32_sqrt=2, f32_div=2)
        reach_rad = max(NEAREST_PX * pixel, REACH_SIGMAS * typical * pixel, REACH_LEFT * left)
        return min(reach_rad, self.profile.tolerance_rad)

    def _weighted(
        self, vectors: Floats, measured: Indices, stars: Indices, weights: Floats | None = None
    ) -> Floats | None:
        """Quaternion of directions (k, 3) of measured stars, weighted by their errors."""
        if weights is None:
            weights = np.float32(1) / (self.sigma_px[measured] ** 2 + FLOOR_PX**2)
        with self.meter.phase("attitude"):
            self.meter.charge(f32_mul=len(measured), f32_div=len(measured))
            try:
                return quest(
                    vectors,
                    self.database.vectors[stars],
                    weights.astype(np.float32),
                    self.meter,
                    eigenvalue=largest_eigenvalue,
                )
            except AttitudeError:
                return None

    def _scale(self, turn: Floats, measured: Indices, stars: Indices) -> float:
        """Focal length beside the field's that suits the stars best; 1 when it hardly matters."""
        known = turned(self.database.vectors[stars], turn)
        known, seen = known[:, :2] / known[:, 2:], self.vectors[measured]
        seen = seen[:, :2] / seen[:, 2:]
        count = len(measured)
        self.meter.charge(f32_mul=13 * count, f32_add=10 * count, f32_div=4 * count + 1)
        scale = float((known * seen).sum() / (known * known).sum())
        edge = np.tan(np.arccos(self.field.smallest_cosine))
        return scale if abs(scale - 1) * edge > SCALE_RAD else 1.0

    def _solution(self, fit: Fit, search: TripleSearch) -> Solution:
        """What the fit is worth; the reason when that is not enough."""
        counts = {"triples": search.triples, "expected": fit.expected}
        straight = self._at_middle_row(fit)
        if straight is None:
            return unsolved(Reason.SMEAR, self.measured, **counts)
        turn = dcm(straight, self.meter)
        errors = np.sqrt(self.sigma_px[fit.measured] ** 2 + FLOOR_PX**2)
        predicted = turned(self.database.vectors[fit.stars], turn)
        apart = fit.vectors - predicted
        try:
            found = covariance(
                predicted,
                np.sqrt((apart * apart).sum(axis=1)),
                (errors * self.field.scale[1]).astype(np.float32),
                self.meter,
                floor=(FLOOR_RAD, FLOOR_RAD, FLOOR_ROLL_RAD),
                excess=EXCESS,
                beyond=BEYOND,
            )
        except AttitudeError:
            return unsolved(Reason.UNCONFIRMED, self.measured, **counts)
        quality = Quality(found, fit.residual_rad, fit.false_alarm, fit.scale)
        if quality.sigma_rad[2] > self.profile.largest_sigma_rad:
            return unsolved(Reason.UNCONFIRMED, self.measured, **counts)
        stars = np.full(len(self.measured), NONE, dtype=np.int32)
        stars[fit.measured] = fit.stars
        return Solution(
            MeasurementOutcome.CONCLUSIVE,
            Reason.CONFIRMED,
            straight,
            stars,
            self.measured,
            candidates=1,
            **counts,
            quality=quality,
        )

    def _at_middle_row(self, fit: Fit) -> Floats | None:
        """The attitude at one instant, when stars moved; None when it can't be told well enough."""
        measured = fit.measured
        still = self.measured.smear_px <= self.profile.smear_px or self.measured.skew_px <= 0
        if still or len(measured) < FEWEST:
            return fit.quaternion
        heights = self.measured.centroids[measured, 1] / np.float32(self.field.rows)
        heights, moved_rad = heights - np.float32(0.5), self.measured.skew_px * self.field.scale[1]
        predicted = turned(self.database.vectors[fit.stars], dcm(fit.quaternion, self.meter))
        self.meter.charge(f32_mul=9 * len(measured), f32_add=6 * len(measured), loop=len(measured))
        straight, weights, sigma_rad = at_middle_row(
            fit.vectors, predicted, heights, moved_rad, self.meter
        )
        doubtful = sigma_rad > self.profile.motion_sigma_rad
        if doubtful and self.measured.skew_px > self.profile.moved_px:
            return None
        return self._weighted(straight, measured, fit.stars, weights)

    def _unsolved(self, reason: Reason, search: TripleSearch) -> Solution:
        return unsolved(
            reason, self.measured, triples=search.triples, candidates=min(search.matches, 0xFFFF)
        )


def in_field(stars: Floats, turn: Floats, field: Field, meter: Meter) -> Indices:
    """Stars (n, 3) that a direction cosine matrix puts into the field: those near the boresight
    first, by one product of integers each, then by their place in the picture."""
    count = len(stars)
    along = stars @ turn[2]
    near = np.flatnonzero(along >= np.float32(field.smallest_cosine))
    meter.charge(ram_read=3 * count // 2, i32_mul=3 * count, i32_add=3 * count, loop=count)
    meter.charge(f32_mul=9 * len(near), f32_add=6 * len(near))
    return near[field.contains(turned(stars[near], turn), meter)]
