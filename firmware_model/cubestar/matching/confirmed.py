"""Identities by hypothesis and confirmation: an attitude is believed only beyond chance.

An extension. Triangles of centroids (``triangles``) propose attitudes; each predicts which stars
of the catalogue are in the picture, and where; ``attitude.confirmation`` tells how often chance
confirms one so well. The first that is below `LARGEST_FALSE_ALARM` a picture is taken, unless
another one of the same centroids is too.

Sides are compared within two fifths of the margin first. If that confirms nothing, other focal
lengths are tried, then the whole margin. Whatever is tried counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.confirmation import (
    by_chance,
    correction,
    false_alarm,
    from_three,
    matched,
    scaled,
)
from cubestack.firmware_model.attitude.field import Field
from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    NONE,
    Identification,
    MatchOutcome,
    unidentified,
)
from cubestack.firmware_model.cubestar.matching.triangles import Step, steps
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, DEFAULT_MARGIN_RAD
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: False alarms a picture, above which an attitude is refused.
LARGEST_FALSE_ALARM = 1e-5

#: Time that identification may take, in s, and what is kept of it for the last attitude.
TIME_LIMIT_S = 0.25
_RESERVE_S = 0.012

#: Stars that a solution needs.
FEWEST_STARS = 3

#: Parts of the margin within which stars are looked for: a place that fits well says more.
_LEVELS = (1.0, 0.5, 0.25)


@dataclass(frozen=True)
class _Pass:
    """One search: by what measured tangents are multiplied, part of the margin, centroids."""

    factor: float
    part: float
    most: int


_TRIALS = [1 + sign * 0.0025 * step for step in range(1, 13) for sign in (1, -1)]
PASSES = (_Pass(1.0, 0.4, 64), *(_Pass(f, 0.4, 12) for f in _TRIALS), _Pass(1.0, 1.0, 64))


@dataclass(frozen=True, eq=False)
class _Candidate:
    """An attitude with the stars that confirm it."""

    centroids: Indices
    stars: Indices
    residuals: Floats
    rotation: Floats
    expected: int
    factor: float
    false_alarm: float


def identify(
    directions: Floats,
    brightness: NDArray[Any] | None,
    catalogue: StarCatalogue,
    field: Field,
    meter: Meter,
    *,
    boresight: Floats | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    limit_s: float = TIME_LIMIT_S,
    largest_false_alarm: float = LARGEST_FALSE_ALARM,
    passes: tuple[_Pass, ...] = PASSES,
) -> Identification:
    """Identify centroids of unit vectors (n, 3): lost in space, or near a `boresight` (3,).

    Phases: `reduction` (assisted only), `distances`, `votes`, `identities`, `verification`,
    `selection`; in each, all tries together.

    Args:
        directions: in camera axes, as the calibration makes them.
        brightness: (n,) the order in which centroids are tried; None is the given order.
        catalogue: stars and pairs.
        field: what of the sky is in the picture.
        meter: charged with every operation.
        boresight: only stars within `CUT_RADIUS_DEG` of it count.
        margin_rad: largest distance of a star from its predicted place.
        limit_s: the part's time, which is not exceeded.
        largest_false_alarm: expected wrong attitudes a picture that are put up with.
        passes: searches to make, one after the other.
    """
    count = len(directions)
    limit = meter.total + round((limit_s - _RESERVE_S) * meter.table.clock_hz)
    if count < FEWEST_STARS:
        return unidentified(count, MatchOutcome.TOO_FEW_CENTROIDS)
    listed = None
    if boresight is not None:
        with meter.phase("reduction"):
            listed = np.zeros(len(catalogue), dtype=bool)
            listed[catalogue.near(boresight, CUT_RADIUS_DEG, meter)] = True
    order = np.arange(count)
    if brightness is not None:
        order = np.lexsort((directions[:, 0], -np.asarray(brightness, np.float32)))
        with meter.phase("distances"):
            meter.charge(i32_add=count * count // 2, loop=count * count // 4)
    search = _Search(directions[order], catalogue, field, meter, margin_rad, listed, limit)
    outcome, best = search.run(passes, largest_false_alarm)
    if best is None:
        nothing = unidentified(count, outcome)
        nothing.votes[:] = search.entries > 0
        return nothing
    stars = np.full(count, NONE, np.int32)
    residuals = np.full(count, np.nan, np.float32)
    votes = np.zeros(count, np.uint8)
    places = order[best.centroids]
    stars[places], residuals[places] = best.stars, best.residuals
    votes[places] = len(places) - 1
    return Identification(
        stars, votes, outcome, best.false_alarm, best.expected, residuals, 1 / best.factor
    )


class _Search:
    """The search of one picture."""

    def __init__(
        self,
        rays: Floats,
        catalogue: StarCatalogue,
        field: Field,
        meter: Meter,
        margin_rad: float,
        listed: NDArray[np.bool_] | None,
        limit: int,
    ) -> None:
        self._rays, self._catalogue, self._field = rays, catalogue, field
        self._meter, self._margin, self._listed = meter, margin_rad, listed
        self._limit = limit
        self.hypotheses = 0.0
        self.largest = LARGEST_FALSE_ALARM
        self.tried = self.entries = 0

    @property
    def _late(self) -> bool:
        return self._meter.total >= self._limit

    def run(
        self, passes: tuple[_Pass, ...], largest: float
    ) -> tuple[MatchOutcome, _Candidate | None]:
        for each in passes:
            with self._meter.phase("distances"):
                rays = scaled(self._rays[: each.most], each.factor, self._meter)
            tolerance = each.part * self._margin
            seen: list[_Candidate] = []
            for step in steps(
                rays, self._catalogue, tolerance, self._listed, self._meter, self._limit
            ):
                self.hypotheses += step.by_chance
                self.entries += step.entries
                believed: list[_Candidate] = []
                for candidate in self._candidates(step, each.factor, tolerance, seen):
                    if candidate.false_alarm <= largest:
                        believed.append(candidate)
                if believed:
                    best = min(believed, key=lambda one: one.false_alarm)
                    if any(_differ(best, other) for other in believed):
                        return MatchOutcome.AMBIGUOUS, None
                    return MatchOutcome.IDENTIFIED, best
                if self._late:
                    return MatchOutcome.NO_TIME, None
            if self._late:
                return MatchOutcome.NO_TIME, None
        unconfirmed = MatchOutcome.UNCONFIRMED if self.tried else MatchOutcome.TOO_FEW_MATCHED
        return unconfirmed, None

    def _candidates(
        self, step: Step, factor: float, tolerance: float, seen: list[_Candidate]
    ) -> Iterator[_Candidate]:
        """Attitudes of the triangles of a step; none that one of `seen` stands for already."""
        for row in np.flatnonzero(~step.mirrored):
            centroids, stars = step.centroids[row], step.stars[row]
            if any(_stands_for(one, centroids, stars) for one in seen):
                continue
            if self._late:
                return
            misfit = min(float(step.misfit[row]) / tolerance, 1.0)
            part = min(level for level in _LEVELS if level >= misfit)
            with self._meter.phase("verification"):
                candidate = self._confirm(centroids, stars, factor, part**3)
            seen.append(candidate)
            yield candidate

    def _confirm(
        self, centroids: Indices, stars: Indices, factor: float, share: float
    ) -> _Candidate:
        """The attitude of a triangle, refined with every star that is where it predicts."""
        self.tried += 1
        meter, vectors, margin = self._meter, self._catalogue.vectors, self._margin
        rays = scaled(self._rays, factor, meter)
        rotation = from_three(rays[centroids], vectors[stars], meter)
        near = self._catalogue.within(rotation[2], self._field.smallest_cosine, meter)
        count = len(near)
        ahead = vectors[near]
        places = turned(ahead, rotation)
        meter.charge(f32_mul=9 * count, f32_add=6 * count, loop=count)
        inside = self._field.contains(places, meter, factor)
        near, ahead, places = near[inside], ahead[inside], places[inside]
        for radius in (3 * margin, margin):
            rows, predicted, _ = matched(rays, places, radius, meter)
            if len(rows) < FEWEST_STARS:
                break
            if self._odds(share, len(near), len(rows), _LEVELS[-1]) > self.largest:
                break
            turn, change = correction(
                rays[rows], places[predicted], meter, with_scale=len(rows) >= 5
            )
            rotation = turn @ rotation
            places = turned(ahead, rotation)
            meter.charge(f32_mul=9 * len(near) + 27, f32_add=6 * len(near) + 18, loop=len(near))
            if change != 1.0:
                factor *= change
                rays = scaled(self._rays, factor, meter)
        rows, predicted, apart = matched(rays, places, margin, meter)
        least = np.inf
        expected = len(near)
        for level in _LEVELS:
            found = int(np.count_nonzero(apart <= level * margin))
            if found < FEWEST_STARS:
                continue
            least = min(least, self._odds(share, expected, found, level))
        return _Candidate(
            rows, near[predicted].astype(np.intp), apart, rotation, expected, factor, least
        )

    def _odds(self, share: float, expected: int, found: int, level: float) -> float:
        """False alarms of an attitude of a triangle whose sides agree so well."""
        chance = by_chance(len(self._rays) - 3, level * self._margin, self._field.solid_angle_sr)
        tries = len(_LEVELS) ** 2 * self.hypotheses * share
        with self._meter.phase("selection"):
            return false_alarm(tries, expected - 3, found - 3, chance, self._meter)


def _stands_for(one: _Candidate, centroids: Indices, stars: Indices) -> bool:
    """Whether an attitude names these centroids with these stars."""
    named = dict(zip(one.centroids.tolist(), one.stars.tolist(), strict=True))
    return all(named.get(c) == s for c, s in zip(centroids.tolist(), stars.tolist(), strict=True))


def _differ(one: _Candidate, other: _Candidate) -> bool:
    """Whether two attitudes are more than 0.5 deg apart."""
    trace = float((one.rotation * other.rotation).sum())
    return trace < 1 + 2 * cos(radians(0.5))
