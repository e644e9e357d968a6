"""From measured stars to an attitude: triples, pivots, identities, QUEST and the outcome.

AraMiS thesis, sections 5.5 to 5.9 and 6.2. In the published profile the three brightest stars are
the main triangle, the next three the pivots, and a unique triangle is accepted. A rough direction
selects the triangles around it; extensions are that it must be close to the boresight found, and
that the sides must agree with the identities, if need be by the second criterion. Appendix E
differs from the text: it measures a pivot even for a unique triangle, so it needs a fourth star,
and it assigns stars by its own listing. With verification (an extension), see `confirmed`.
"""

from dataclasses import dataclass, replace

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.assignment import assign, assign_plainly
from cubestack.firmware_model.aramis.matching.confirmed import identify_confirmed
from cubestack.firmware_model.aramis.matching.triples import Match, match_triple
from cubestack.firmware_model.aramis.solution import NONE, Profile, Solution, StarList, unsolved
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import volumes

MOST_STEPS = 10
#: The largest value at 1 seen among 20 000 exact sets of 3 to 11 stars is 1.8e-7.
ROUNDING = np.float32(5e-7)

_ZERO, _ONE, _TWO, _FOUR = (np.float32(value) for value in (0, 1, 2, 4))


def quartic(profile: Floats, meter: Meter) -> tuple[np.float32, np.float32, np.float32]:
    """Coefficients of the square, the linear and the constant term of equation 6.8, the
    characteristic quartic; its printed constant term is corrected to ab + cs - d."""
    matrix = profile + profile.T
    trace = profile[0, 0] + profile[1, 1] + profile[2, 2]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix
    z0 = profile[1, 2] - profile[2, 1]
    z1 = profile[2, 0] - profile[0, 2]
    z2 = profile[0, 1] - profile[1, 0]
    minor_x, minor_y, minor_z = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    determinant = xx * minor_x - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    s0, s1, s2 = (row[0] * z0 + row[1] * z1 + row[2] * z2 for row in matrix)
    a = trace * trace - (minor_x + minor_y + minor_z)
    b = trace * trace + z0 * z0 + z1 * z1 + z2 * z2
    c = determinant + z0 * s0 + z1 * s1 + z2 * s2
    d = s0 * s0 + s1 * s1 + s2 * s2
    meter.charge(f32_add=11 + 3 + 4 + 6 + 12 + 2 + 1, f32_mul=6 + 7 + 9 + 1 + 3 + 3 + 3 + 2)
    return -(a + b), -c, a * b + c * trace - d


def largest_eigenvalue(profile: Floats, meter: Meter) -> np.float32:
    """Root of the quartic next to 1, for a profile (3, 3) of weights that add up to 1.

    Newton's method from 1, in single precision. In a narrow field the two largest roots are so
    close that rounding of the coefficients would move the root by more than the noise of the
    directions, and the attitude by degrees. So a value of the quartic within `ROUNDING` counts as
    0. With matching stars the root remains 1, as in Shuster's shortcut; with contradicting ones it
    moves.
    """
    square, linear, constant = quartic(profile, meter)
    root = _ONE
    for _ in range(MOST_STEPS):
        value = ((root * root + square) * root + linear) * root + constant
        if abs(value) <= ROUNDING:
            break
        slope = (_FOUR * root * root + _TWO * square) * root + linear
        meter.charge(f32_mul=7, f32_add=5, f32_div=1, f32_compare=2, loop=1)
        if slope <= _ZERO:
            break
        root -= value / slope
    return min(root, _ONE)


def identify(
    measured: StarList,
    field: CameraField,
    profile: Profile,
    database: Database,
    meter: Meter,
    hint: Floats | None = None,
    until: float | None = None,
) -> Solution:
    """Identify measured stars, the brightest first, and solve the attitude.

    ``hint`` (3,) is a rough unit vector of the boresight in inertial axes; None: lost in space.
    With verification it is given up when the meter shows ``until`` cycles; None: the profile's time
    from now on. Phases: `faces`, `triangles`, `search`, `pivoting`, `identities`, `attitude`,
    `verification`.
    """
    if profile.verify:
        if until is None:
            until = meter.total + profile.within_ms * meter.table.clock_hz / 1000
        return identify_confirmed(measured, field, profile, database, hint, meter, until)
    if len(measured) < 3 + profile.always_pivot:
        return unsolved(Reason.TOO_FEW_STARS, measured)
    vectors = field.directions(measured.centroids, meter)
    faces = None
    if hint is not None:
        with meter.phase("faces"):
            faces = database.sphere.around(hint, meter)
    return _Search(measured, vectors, field, profile, database, hint, faces, meter).published()


@dataclass(frozen=True)
class _Search:
    """One picture's identification."""

    measured: StarList
    vectors: Floats
    field: CameraField
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

    def _match(self, main: tuple[int, int, int]) -> Match:
        profile, count = self.profile, len(self.measured)
        pivots = [star for star in range(count) if star not in main][: profile.pivots]
        return match_triple(
            self.vectors,
            main,
            pivots,
            profile.sigma_rad,
            self.database,
            self.faces,
            self.meter,
            None if profile.always_pivot else 1,
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
            found = assign(
                *(brightness, sides, v_mag, known, self.meter), by_variance=self.profile.by_variance
            )
        differ = self.profile.identities == "either" and (found.order != found.other).any()
        return [stars[order] for order in (found.order, found.other)[: 1 + differ]]

    def _sides_agree(self, main: tuple[int, int, int], identities: Indices) -> bool:
        measured, known = self.vectors[list(main)], self.database.vectors[identities]
        with self.meter.phase("verification"):
            return sides_agree(measured, known, self.profile.side_tolerance_rad, self.meter)

    def _attitude(self, measured: Indices, identities: Indices) -> Floats | None:
        body, reference = self.vectors[measured], self.database.vectors[identities]
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
        outcome = MeasurementOutcome.CONCLUSIVE
        return Solution(outcome, reason, quaternion, stars, self.measured, rating=None, **counts)


def sides_agree(vectors: Floats, catalogue: Floats, tolerance: float, meter: Meter) -> bool:
    """Whether two triangles of unit vectors (3, 3) agree within a tolerance: in each side, as area
    and moment leave one measure of a triangle free, and in the volume of the three vectors, whose
    sign distinguishes a triangle from its mirror image."""
    meter.charge(f32_add=33 + 11, f32_mul=18 + 18, f32_sqrt=6, f32_compare=4, loop=3)
    edges = (corners[[0, 1, 0]] - corners[[1, 2, 2]] for corners in (vectors, catalogue))
    measured, expected = (np.sqrt(np.sum(edge**2, axis=1)) for edge in edges)
    apart = np.append(measured - expected, np.subtract(*volumes(np.stack([vectors, catalogue]))))
    return bool(np.all(np.abs(apart) <= np.float32(tolerance)))
