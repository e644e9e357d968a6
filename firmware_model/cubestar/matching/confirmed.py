"""Identities by hypothesis and confirmation: an attitude is believed only beyond chance.

An extension. Triangles of centroids (``triangles``) propose attitudes; each predicts which stars
of the catalogue are in the picture, and where; ``attitude.confirmation`` tells how often chance
confirms one so well. The first with less than `SURE` in a picture is taken. Where none has, the
best below `LARGEST_FALSE_ALARM` is, unless another attitude or the mirrored sky is below it too.

The sides of the brightest centroids are compared within two fifths of the margin first. If that
confirms nothing, the picture is looked at in a mirror, which can only tell why; then other focal
lengths are tried, each with few centroids, as there are many; then all centroids, then the whole
margin. Whatever is tried counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import acos, degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.confirmation import from_three, scaled, volume
from cubestack.firmware_model.attitude.field import Field
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    Identification,
    MatchOutcome,
    identified,
    unidentified,
)
from cubestack.firmware_model.cubestar.matching.prediction import (
    LARGEST_FALSE_ALARM,
    LEVELS,
    Candidate,
    Picture,
)
from cubestack.firmware_model.cubestar.matching.triangles import Step, steps
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, DEFAULT_MARGIN_RAD
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]

#: Time that identification may take, in s, and what is kept of it for the last attitude.
TIME_LIMIT_S = 0.25
_RESERVE_S = 0.018

#: Stars that a solution needs.
FEWEST_STARS = 3

#: False alarms at which an attitude is taken at once; above, the search goes on for rivals.
SURE = 1e-9

#: Attitudes further apart than this are rivals.
_SAME_DEG = 0.5


@dataclass(frozen=True)
class Pass:
    """One search: by what tangents of field angles are multiplied, the part of the margin within
    which sides agree, how many centroids take part, and whether the picture is seen in a mirror."""

    factor: float = 1.0
    part: float = 0.4
    most: int = 64
    mirrored: bool = False


_OTHER_LENSES = [1 + sign * 0.0025 * step for step in range(1, 13) for sign in (1, -1)]
PASSES = (
    Pass(most=24),
    Pass(most=10, mirrored=True),
    *(Pass(factor, most=8) for factor in _OTHER_LENSES),
    Pass(),
    Pass(part=1.0),
)


def identify(
    directions: Floats,
    brightness: NDArray[Any] | None,
    catalogue: StarCatalogue,
    field: Field,
    meter: Meter,
    *,
    boresight: Floats | None = None,
    radius_deg: float = CUT_RADIUS_DEG,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    limit_s: float = TIME_LIMIT_S,
    largest_false_alarm: float = LARGEST_FALSE_ALARM,
    passes: tuple[Pass, ...] = PASSES,
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
        boresight: only stars within `radius_deg` of it count.
        radius_deg: half the field and what the boresight may be wrong by.
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
            listed[catalogue.near(boresight, radius_deg, meter)] = True
    order = np.arange(count)
    if brightness is not None:
        order = np.lexsort((directions[:, 0], -np.asarray(brightness, np.float32)))
        with meter.phase("distances"):
            meter.charge(i32_add=count * count // 2, loop=count * count // 4)
    picture = Picture(directions[order], catalogue, field, margin_rad, meter)
    search = _Search(picture, listed, limit, largest_false_alarm)
    best = search.run(passes)
    if isinstance(best, Candidate):
        return identified(order[best.centroids], best, count)
    nothing = unidentified(count, best)
    nothing.votes[:] = search.entries > 0
    return nothing


class _Search:
    """The search of one picture.

    Attributes:
        chance: triangles that chance gives, to be expected so far.
        tried: attitudes tried.
        entries: entries of the pair list that were as wide as a pair.
    """

    def __init__(
        self, picture: Picture, listed: NDArray[np.bool_] | None, limit: int, largest: float
    ) -> None:
        self._picture, self._listed, self._limit = picture, listed, limit
        self._largest = largest
        self.chance = 0.0
        self.tried = self.entries = 0

    @property
    def _late(self) -> bool:
        return self._picture.meter.total >= self._limit

    def run(self, passes: tuple[Pass, ...]) -> Candidate | MatchOutcome:
        """The attitude that is believed, or why there is none."""
        meter, weak = self._picture.meter, list[Candidate]()
        for each in passes:
            if weak and not each.mirrored:
                break
            picture = self._picture.mirrored() if each.mirrored else self._picture
            with meter.phase("distances"):
                rays = scaled(picture.directions[: each.most], each.factor, meter)
            tolerance = each.part * picture.margin_rad
            seen: list[dict[int, int]] = []
            newest = 0
            for step in steps(rays, picture.catalogue, tolerance, self._listed, meter, self._limit):
                newest = step.newest
                self.chance += step.by_chance
                self.entries += step.entries
                candidates = self._candidates(step, picture, each.factor, tolerance, seen)
                believed = [one for one in candidates if one.false_alarm <= self._largest]
                if believed and each.mirrored:
                    return MatchOutcome.MIRRORED
                weak += believed
                best = min(weak, key=lambda one: one.false_alarm, default=None)
                if best is not None and best.false_alarm <= SURE:
                    return best
            if not weak and (self._late or newest < len(rays) - 1):
                return MatchOutcome.NO_TIME
        if weak:
            best = min(weak, key=lambda one: one.false_alarm)
            rivals = any(_apart_deg(best, other) > _SAME_DEG for other in weak)
            return MatchOutcome.AMBIGUOUS if rivals else best
        return MatchOutcome.UNCONFIRMED if self.tried else MatchOutcome.TOO_FEW_MATCHED

    def _candidates(
        self,
        step: Step,
        picture: Picture,
        factor: float,
        tolerance: float,
        seen: list[dict[int, int]],
    ) -> Iterator[Candidate]:
        """Attitudes of the triangles of a step, but not of those that one of `seen` has within it:
        star of each centroid that attitudes tried so far name."""
        for row, (centroids, stars) in enumerate(zip(step.centroids, step.stars, strict=True)):
            if self._late:
                return
            here = picture.directions.take(centroids, axis=0)
            there = picture.catalogue.vectors.take(stars, axis=0)
            if (volume(here) < 0) != (volume(there) < 0):  # it turns the other way
                continue
            named = dict(zip(centroids.tolist(), stars.tolist(), strict=True))
            if any(named.items() <= one.items() for one in seen):
                continue
            misfit = min(float(step.misfit[row]) / tolerance, 1.0)
            # Entries and both rings are narrower by this part: its cube of triangles by chance.
            part = min(level for level in LEVELS if level >= misfit)
            tries = len(LEVELS) * self.chance * part**3
            self.tried += 1
            with picture.meter.phase("verification"):
                rotation = from_three(scaled(here, factor, picture.meter), there, picture.meter)
                candidate = picture.confirm(
                    rotation, FEWEST_STARS, tries, factor=factor, largest=self._largest
                )
            confirming = zip(candidate.centroids.tolist(), candidate.stars.tolist(), strict=True)
            seen.append(dict(confirming))
            yield candidate


def _apart_deg(one: Candidate, other: Candidate) -> float:
    """Angle between two attitudes, in degrees."""
    cosine = (float((one.rotation * other.rotation).sum()) - 1) / 2
    return degrees(acos(max(-1.0, min(cosine, 1.0))))
