"""Results of all matching modes, and the verification that they share.

CubeStar thesis, section 4.3.3 (verification round, stars within one vote of the maximum) and
section 5.3.4 (the weights are the verification votes). Kept stars may contradict each other; they
can be thinned until every pair agrees. Two centroids with one identity then contradict each other.
"""

from dataclasses import dataclass, field
from functools import cached_property
from math import nan
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_cosine
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import Candidate
from cubestack.firmware_model.star_tracker.search import MatchOutcome

#: Mark of a centroid without identity.
NONE = -1


@dataclass(frozen=True, eq=False)
class Identification:
    """Identities of the centroids of one picture."""

    #: (n,) index into the star list for each centroid, -1 for none. All are -1 unless the outcome
    #: is IDENTIFIED.
    stars: NDArray[np.int32]
    #: (n,) verification votes of each centroid: other centroids that confirmed the identity which
    #: it was given before the final selection
    votes: NDArray[np.uint8]
    outcome: MatchOutcome  #: how it ended
    #: wrong attitudes to be expected in such a picture that would be confirmed as well; nan where
    #: nothing is confirmed by its stars
    false_alarm: float = nan
    expected: int = 0  #: catalogue stars that the attitude puts into the picture
    #: (n,) angle in rad between each centroid and its star; nan without identity
    residuals: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    #: tangents of measured field angles over true ones; 1 where the focal length is right
    scale: float = 1.0

    @cached_property
    def matched(self) -> NDArray[np.intp]:
        """Centroids that have an identity, rising."""
        return np.flatnonzero(self.stars != NONE)

    @cached_property
    def confidence(self) -> NDArray[np.float32]:
        """(n,) votes over the largest number possible; 0 for a centroid without identity."""
        most = max(len(self.stars) - 1, 1)
        part = self.votes.astype(np.float32) / np.float32(most)
        return np.where(self.stars != NONE, part, np.float32(0))


def unidentified(count: int, outcome: MatchOutcome) -> Identification:
    """Identification of ``count`` centroids without a result."""
    return Identification(
        np.full(count, NONE, dtype=np.int32), np.zeros(count, dtype=np.uint8), outcome
    )


def identified(centroids: NDArray[np.intp], confirmed: Candidate, count: int) -> Identification:
    """Identification of ``count`` centroids by an attitude that some of them confirm."""
    stars = np.full(count, NONE, np.int32)
    residuals = np.full(count, nan, np.float32)
    votes = np.zeros(count, np.uint8)
    stars[centroids], residuals[centroids] = confirmed.stars, confirmed.residuals
    votes[centroids] = len(centroids) - 1
    return Identification(
        stars,
        votes,
        MatchOutcome.IDENTIFIED,
        confirmed.false_alarm,
        confirmed.expected,
        residuals,
        1 / confirmed.factor,
    )


def angles_between(
    a: NDArray[np.float32], b: NDArray[np.float32], meter: Meter
) -> NDArray[np.float32]:
    """Angles in rad between unit vectors (n, 3) row by row: equation 4.3.1 in single precision."""
    cosine = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    count = len(a)
    meter.charge(f32_mul=3 * count, f32_add=2 * count, f32_compare=2 * count, f32_acos=count)
    return arc_cosine(np.clip(cosine, np.float32(-1), np.float32(1)))


@dataclass(frozen=True, eq=False)
class CentroidPairs:
    """Every pair of centroids and the angle between them, computed once."""

    count: int  #: number of centroids
    #: (p,) the pairs, first below second
    first: NDArray[np.intp]
    second: NDArray[np.intp]
    angle: NDArray[np.float32]  #: (p,) in rad

    @classmethod
    def measure(cls, directions: NDArray[np.float32], meter: Meter) -> Self:
        first, second = np.triu_indices(len(directions), k=1)
        angle = angles_between(directions[first], directions[second], meter)
        meter.charge(loop=len(first), ram_read=6 * len(first), ram_write=len(first))
        return cls(len(directions), first, second, angle)


def verify(
    pairs: CentroidPairs,
    identities: NDArray[np.int32],
    vectors: NDArray[np.float32],
    margin_rad: float,
    meter: Meter,
    *,
    thinned: bool,
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Let every pair of centroids vote for its identities (n,), indices into ``vectors`` or -1.

    Returns the votes (n,), and the identities with -1 for what was dropped: votes below one less
    than the maximum or, if ``thinned``, no vote or a contradiction with the other kept stars.
    """
    named = (identities[pairs.first] != NONE) & (identities[pairs.second] != NONE)
    first, second = pairs.first[named], pairs.second[named]
    catalogue = angles_between(vectors[identities[first]], vectors[identities[second]], meter)
    agree = np.abs(catalogue - pairs.angle[named]) <= np.float32(margin_rad)
    if thinned:
        agree &= identities[first] != identities[second]
    agreement = np.zeros((pairs.count, pairs.count), dtype=bool)
    agreement[first[agree], second[agree]] = True
    agreement |= agreement.T
    votes = agreement.sum(axis=1).astype(np.uint8)
    meter.charge(
        loop=len(named),
        flash_read=6 * len(first),
        f32_add=len(first),
        f32_compare=len(first),
        i32_add=len(first) + 2 * int(agree.sum()),
        ram_write=3 * int(agree.sum()),
    )
    kept = votes + 1 >= votes.max(initial=0)
    if thinned:
        kept = _consistent(agreement, kept & (votes > 0), meter)
    return votes, np.where(kept, identities, NONE).astype(np.int32)


def _consistent(
    agreement: NDArray[np.bool_], kept: NDArray[np.bool_], meter: Meter
) -> NDArray[np.bool_]:
    """Drop the star with the fewest agreements until all kept stars (n,) agree pairwise."""
    kept = kept.copy()
    while True:
        members = np.flatnonzero(kept)
        inside = agreement[np.ix_(members, members)].sum(axis=1)
        meter.charge(
            table_byte=len(members) ** 2, i32_add=len(members) ** 2, loop=len(members) ** 2
        )
        if len(members) == 0 or inside.min() == len(members) - 1:
            return kept
        kept[members[np.argmin(inside)]] = False
