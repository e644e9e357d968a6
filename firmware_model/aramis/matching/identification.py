"""From measured stars to an attitude: triples, pivots, identities, QUEST and the outcome.

AraMiS thesis, sections 5.5 to 5.9 and 6.2. In the published profile the three brightest stars are
the main triangle, the next three the pivots, and a unique triangle is believed. A rough direction
leaves the triangles around it; an extension is that it also must be close to the boresight found,
and that the sides must agree with the identities, of which the second choice will do. Appendix E
differs from the text: it measures a pivot even for a unique triangle, so it needs a fourth star,
and it tells stars apart in its own way.

With verification (an extension), an attitude must be confirmed by further stars. Then every
candidate is tried, with both ways of telling its stars apart; pivots, which a false star would
spoil, only serve to leave few enough; and further triples of stars follow when none is confirmed.
The confirmed attitude is solved again with all stars that confirm it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.matching.assignment import assign, assign_plainly
from cubestack.firmware_model.aramis.matching.eigenvalue import largest_eigenvalue
from cubestack.firmware_model.aramis.matching.shutter import FEWEST, at_middle_row
from cubestack.firmware_model.aramis.matching.triples import Match, match_triple
from cubestack.firmware_model.aramis.matching.verification import confirm, sides_agree
from cubestack.firmware_model.aramis.solution import NONE, Profile, Solution, StarList, unsolved
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter


def identify(
    measured: StarList,
    field: Field,
    profile: Profile,
    database: Database,
    meter: Meter,
    hint: Floats | None = None,
) -> Solution:
    """Identify measured stars, the brightest first, and solve the attitude.

    ``hint`` (3,) is a rough unit vector of the boresight in inertial axes; None: lost in space.
    Phases: `faces`, `triangles`, `search`, `pivoting`, `identities`, `attitude`, `verification`.
    """
    # As published, there is no such reason, and its spike removal cuts stars into long pieces.
    smeared = profile.verify and measured.smear_px > profile.smear_px
    if smeared and measured.skew_px > profile.skew_px:
        return unsolved(Reason.SMEAR, measured)
    if len(measured) < 3 + profile.always_pivot:
        return unsolved(Reason.SMEAR if smeared else Reason.TOO_FEW_STARS, measured)
    vectors = field.directions(measured.centroids, meter)
    faces = None
    if hint is not None:
        with meter.phase("faces"):
            faces = database.sphere.around(hint, meter)
    search = _Search(measured, vectors, field, profile, database, hint, faces, meter)
    solution = search.verified() if profile.verify else search.published()
    if smeared and solution.outcome is MeasurementOutcome.NONE:
        return replace(solution, reason=Reason.SMEAR)
    return solution


@dataclass(frozen=True)
class _Search:
    """One picture's identification."""

    measured: StarList
    vectors: Floats
    field: Field
    profile: Profile
    database: Database
    hint: Floats | None
    faces: Mask | None
    meter: Meter

    def published(self) -> Solution:
        """The three brightest stars, and nothing that contradicts."""
        main = (0, 1, 2)
        match = self._match(main)
        counts = match.counts | {"triples": 1}
        if match.end is not Reason.UNIQUE:
            several = match.end is Reason.SEVERAL
            outcome = MeasurementOutcome.AMBIGUOUS if several else MeasurementOutcome.NONE
            return replace(unsolved(match.end, self.measured, **counts), outcome=outcome)
        choices = self._identities(main, match, int(match.candidates[0]))
        if self.hint is not None and self.profile.filtered:
            choices = [choice for choice in choices if self._sides_agree(main, choice)]
            if not choices:
                return unsolved(Reason.UNCONFIRMED, self.measured, **counts)
        identities = choices[0]
        quaternion = self._attitude(np.array(main), identities)
        if quaternion is None:
            return unsolved(Reason.DEGENERATE, self.measured, **counts)
        if self.profile.filtered and self._far_from_hint(quaternion):
            return unsolved(Reason.FAR_FROM_HINT, self.measured, **counts)
        return self._solution(match.end, quaternion, np.array(main), identities, **counts)

    def verified(self) -> Solution:
        """Triples until the attitude of one is confirmed."""
        hypotheses = triples = 0
        reason = None
        for triples, main in enumerate(self._triples(), 1):
            match = self._match(main)
            if len(match.candidates):
                reason = Reason.UNCONFIRMED
            reason = reason or match.end
            for triangle in match.candidates[: self.profile.candidates].tolist():
                for identities in self._identities(main, match, triangle):
                    if not self._sides_agree(main, identities):
                        continue
                    hypotheses += 1
                    quaternion = self._attitude(np.array(main), identities)
                    if quaternion is None or self._far_from_hint(quaternion):
                        continue
                    found = self._confirm(quaternion, hypotheses)
                    if found is None:
                        continue
                    quaternion, stars, identities, expected = found
                    straight = self._at_middle_row(quaternion, stars, identities)
                    if straight is None:
                        return unsolved(Reason.SMEAR, self.measured)
                    counts = match.counts | {"triples": triples, "expected": expected}
                    return self._solution(Reason.CONFIRMED, straight, stars, identities, **counts)
        return unsolved(reason or Reason.TOO_FEW_STARS, self.measured, triples=triples)

    def _triples(self) -> Iterator[tuple[int, int, int]]:
        """Triples of the brightest stars, by the sum of their ranks."""
        count = min(len(self.measured), self.profile.triple_stars)
        triples = sorted(combinations(range(count), 3), key=lambda triple: (sum(triple), triple))
        yield from triples[: self.profile.triples]

    def _match(self, main: tuple[int, int, int]) -> Match:
        profile, count = self.profile, len(self.measured)
        pivots = [star for star in range(count) if star not in main][: profile.pivots]
        enough = profile.candidates if profile.verify else 1
        return match_triple(
            self.vectors,
            main,
            pivots,
            profile.sigma_rad,
            self.database,
            self.faces,
            self.meter,
            None if profile.always_pivot else enough,
        )

    def _identities(self, main: tuple[int, int, int], match: Match, triangle: int) -> list[Indices]:
        """Star of the database for each of the three, by the score; then by the other criterion."""
        assert match.main is not None
        database, stars = self.database, self.database.stars[triangle].astype(np.intp)
        brightness, known = self.measured.brightness[list(main)], database.vectors[stars]
        with self.meter.phase("identities"):
            sides, v_mag = match.main.sides, database.v_mag[stars]
            if self.profile.identities == "appendix-e":
                return [stars[assign_plainly(brightness, sides, known, self.meter)]]
            found = assign(brightness, sides, v_mag, known, self.meter)
        differ = self.profile.identities == "either" and (found.order != found.other).any()
        return [stars[order] for order in (found.order, found.other)[: 1 + differ]]

    def _sides_agree(self, main: tuple[int, int, int], identities: Indices) -> bool:
        measured, known = self.vectors[list(main)], self.database.vectors[identities]
        with self.meter.phase("verification"):
            return sides_agree(measured, known, self.profile.side_tolerance_rad, self.meter)

    def _attitude(
        self,
        measured: Indices,
        identities: Indices,
        vectors: Floats | None = None,
        weights: Floats | None = None,
    ) -> Floats | None:
        """Of identified stars; by default their own vectors, all of the same weight."""
        body = self.vectors[measured] if vectors is None else vectors
        reference = self.database.vectors[identities]
        if weights is None:
            weights = np.ones(len(measured), dtype=np.float32)
        with self.meter.phase("attitude"):
            try:
                return quest(body, reference, weights, self.meter, eigenvalue=largest_eigenvalue)
            except AttitudeError:
                return None

    def _far_from_hint(self, quaternion: Floats) -> bool:
        if self.hint is None:
            return False
        with self.meter.phase("faces"):
            boresight = dcm(quaternion, self.meter)[2]
            self.meter.charge(f32_mul=3, f32_add=2, f32_compare=1)
        limit = np.cos(np.radians(self.profile.hint_tolerance_deg))
        return not np.dot(boresight, self.hint.astype(np.float32)) >= np.float32(limit)

    def _confirm(
        self, quaternion: Floats, tried: int
    ) -> tuple[Floats, Indices, Indices, int] | None:
        """Confirmed attitude of all stars that agree, those stars, and how many were expected."""
        reach_rad = self.profile.tolerance_rad
        for _ in range(2):
            found = confirm(
                quaternion, self.vectors, self.database, self.field, reach_rad, tried, self.meter
            )
            close = found.spread_rad < self.profile.spread_rad
            if close or found.chance > self.profile.largest_chance:
                return None
            refined = self._attitude(found.measured, found.stars)
            if refined is None:
                return None
            quaternion = refined
        return quaternion, found.measured, found.stars, found.expected

    def _at_middle_row(
        self, quaternion: Floats, measured: Indices, stars: Indices
    ) -> Floats | None:
        """The attitude at one instant, when stars moved; None when it can't be told well enough."""
        still = self.measured.smear_px <= self.profile.smear_px or self.measured.skew_px <= 0
        if still or len(measured) < FEWEST:
            return quaternion
        heights = self.measured.centroids[measured, 1] / np.float32(self.field.rows)
        heights, moved_rad = heights - np.float32(0.5), self.measured.skew_px * self.field.scale[1]
        with self.meter.phase("attitude"):
            predicted = self.database.vectors[stars] @ dcm(quaternion, self.meter).T
            self.meter.charge(f32_mul=9 * len(stars), f32_add=6 * len(stars), loop=len(stars))
            straight, weights, sigma_rad = at_middle_row(
                self.vectors[measured], predicted, heights, moved_rad, self.meter
            )
        doubtful = sigma_rad > self.profile.motion_sigma_rad
        if doubtful and self.measured.skew_px > self.profile.moved_px:
            return None
        return self._attitude(measured, stars, straight, weights)

    def _solution(
        self,
        reason: Reason,
        quaternion: Floats,
        measured: Indices,
        identities: Indices,
        **counts: int,
    ) -> Solution:
        stars = np.full(len(self.measured), NONE, dtype=np.int32)
        stars[measured] = identities
        return Solution(
            MeasurementOutcome.CONCLUSIVE, reason, quaternion, stars, self.measured, **counts
        )
