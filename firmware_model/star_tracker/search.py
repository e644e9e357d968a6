"""Search for an attitude: triangles propose attitudes, and one is accepted only beyond chance.

A sensor's catalogue proposes triangles of measured and catalogue stars, pass by pass. Each defines
an attitude, which ``observation`` refines and rates by its expected false alarms. The first one
with at most `sure` is accepted at once. Otherwise the search continues for rivals, and accepts the
best one with at most `largest`, unless another attitude or the mirrored sky has so few too.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from math import acos, degrees

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.star_tracker.confirmation import from_three, volumes
from cubestack.firmware_model.star_tracker.observation import Candidate, Observation

Indices = NDArray[np.intp]

STARS_OF_TRIANGLE = 3

#: Attitudes further apart than this are rivals.
_SAME_DEG = 0.5


class MatchOutcome(Enum):
    """How an identification ended."""

    IDENTIFIED = "enough stars were identified"
    TOO_FEW_CENTROIDS = "there were fewer centroids than an attitude needs"
    TOO_FEW_MATCHED = "fewer stars agreed with each other than an attitude needs"
    MIRRORED = "the stars agree with the mirror image of the sky only"
    UNCONFIRMED = "no attitude is confirmed by more stars than chance would give"
    AMBIGUOUS = "two attitudes are confirmed"
    NO_TIME = "no time was left to try more attitudes"


@dataclass(eq=False)  # one for each step: a frozen one would take four times as long
class Triangles:
    """Triangles of measured stars that agree with triangles of the catalogue."""

    #: (t, 3) measured stars, and those of the catalogue, in the order to try
    centroids: Indices
    stars: Indices
    shares: NDArray[np.floating]  #: (t,) of the wrong triangles by chance, those that agree as well
    factors: NDArray[np.floating]  #: (t,) by which tangents of measured field angles are multiplied
    by_chance: float  #: triangles that chance gives, to be expected since the step before


@dataclass(frozen=True, eq=False)
class SearchPass:
    """One pass over an observation: steps of triangles, None where it ends before all of them. A
    mirrored observation can only rule out what was found."""

    observation: Observation
    steps: Iterator[Triangles | None]
    mirrored: bool = False


@dataclass
class AttitudeSearch:
    """The search of one picture."""

    limit: float  #: cycles of the meter at which time is over
    largest: float  #: false alarms a picture, above which an attitude is not believed
    sure: float  #: false alarms at which it is taken at once
    fewest: int = STARS_OF_TRIANGLE  #: stars that an attitude needs
    chance: float = 0.0  #: triangles that chance gives, to be expected so far
    tried: int = 0  #: attitudes tried

    def run(self, passes: Iterable[SearchPass]) -> Candidate | MatchOutcome:
        """The accepted attitude, or why there is none."""
        weak: list[Candidate] = []
        for each in passes:
            if weak and not each.mirrored:
                break
            complete = True
            seen: list[dict[int, int]] = []
            for step in each.steps:
                complete = step is not None
                if step is None:
                    break
                self.chance += step.by_chance
                believed = [
                    candidate
                    for candidate in self._candidates(step, each.observation, seen)
                    if candidate.false_alarm <= self.largest and len(candidate.stars) >= self.fewest
                ]
                if believed and each.mirrored:
                    return MatchOutcome.MIRRORED
                weak += believed
                best = min(weak, key=lambda one: one.false_alarm, default=None)
                if best is not None and best.false_alarm <= self.sure:
                    return best
                if self._late(each.observation):
                    break
            if not weak and (not complete or self._late(each.observation)):
                return MatchOutcome.NO_TIME
        if weak:
            best = min(weak, key=lambda one: one.false_alarm)
            rivals = any(_apart_deg(best, other) > _SAME_DEG for other in weak)
            return MatchOutcome.AMBIGUOUS if rivals else best
        return MatchOutcome.UNCONFIRMED if self.tried else MatchOutcome.TOO_FEW_MATCHED

    def _late(self, observation: Observation) -> bool:
        return observation.meter.total >= self.limit

    def _candidates(
        self, step: Triangles, observation: Observation, seen: list[dict[int, int]]
    ) -> Iterator[Candidate]:
        """Attitudes of triangles, except of those in ``seen``: the star of each centroid, by the
        attitudes tried so far."""
        meter = observation.meter
        measured = observation.directions.take(step.centroids, axis=0)
        known = observation.stars.vectors.take(step.stars, axis=0)
        turned_alike = (volumes(measured) < 0) == (volumes(known) < 0)
        for row in np.flatnonzero(turned_alike):
            if self._late(observation):
                return
            centroids, stars = step.centroids[row], step.stars[row]
            named = dict(zip(centroids.tolist(), stars.tolist(), strict=True))
            if any(named.items() <= one.items() for one in seen):
                continue
            tries, factor = self.chance * float(step.shares[row]), float(step.factors[row])
            self.tried += 1
            with meter.phase("verification"):
                rotation = from_three(scaled(measured[row], factor, meter), known[row], meter)
                candidate = observation.confirm(
                    rotation, STARS_OF_TRIANGLE, tries, factor=factor, largest=self.largest
                )
            seen.append(
                dict(zip(candidate.centroids.tolist(), candidate.stars.tolist(), strict=True))
            )
            yield candidate


def _apart_deg(one: Candidate, other: Candidate) -> float:
    cosine = (float((one.rotation * other.rotation).sum()) - 1) / 2
    return degrees(acos(max(-1.0, min(cosine, 1.0))))
