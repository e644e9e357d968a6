"""Identities by hypothesis and confirmation: an attitude is believed only beyond chance.

An extension. Triangles of the pair list (``pair_triangles``) propose attitudes to the search that
all star trackers share (``star_tracker.search``). The sides of the brightest centroids are compared
within two fifths of the margin first. If that confirms nothing, the mirrored picture is tried,
which can only explain the failure; then other focal lengths, each with few centroids, as there are
many; then all centroids, then the whole margin. Every attempt counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.field_of_view import FieldOfView
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    Identification,
    identified,
    unidentified,
)
from cubestack.firmware_model.cubestar.matching.pair_triangles import PairTriangles
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, DEFAULT_MARGIN_RAD
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.observation import (
    LARGEST_FALSE_ALARM,
    Candidate,
    Observation,
)
from cubestack.firmware_model.star_tracker.search import (
    STARS_OF_TRIANGLE,
    AttitudeSearch,
    MatchOutcome,
    SearchPass,
)

Floats = NDArray[np.float32]

#: Time that identification may take, in s, and the part of it reserved for the last attitude.
TIME_LIMIT_S = 0.25
_RESERVE_S = 0.018

#: False alarms at which an attitude is taken at once; above, the search goes on for rivals.
SURE = 1e-9


@dataclass(frozen=True)
class PairPass:
    """Settings of a pass: factor of the tangents of field angles, share of the margin within which
    sides agree, largest number of centroids, and whether the picture is mirrored."""

    factor: float = 1.0
    part: float = 0.4
    most: int = 64
    mirrored: bool = False


_OTHER_LENSES = [1 + sign * 0.0025 * step for step in range(1, 13) for sign in (1, -1)]
PASSES = (
    PairPass(most=24),
    PairPass(most=10, mirrored=True),
    *(PairPass(factor, most=8) for factor in _OTHER_LENSES),
    PairPass(),
    PairPass(part=1.0),
)


def identify(
    directions: Floats,
    brightness: NDArray[Any] | None,
    catalogue: StarCatalogue,
    field: FieldOfView,
    meter: Meter,
    *,
    boresight: Floats | None = None,
    radius_deg: float = CUT_RADIUS_DEG,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    limit_s: float = TIME_LIMIT_S,
    largest_false_alarm: float = LARGEST_FALSE_ALARM,
    passes: tuple[PairPass, ...] = PASSES,
) -> Identification:
    """Identify centroids of unit vectors (n, 3): lost in space, or near a `boresight` (3,).

    Phases: `reduction` (assisted only), `distances`, `votes`, `identities`, `verification`,
    `selection`, each summed over all tries.

    Args:
        directions: in camera axes, by the calibration.
        brightness: (n,) decides the order in which centroids are tried; None keeps it.
        radius_deg: only stars within it of the `boresight` count: half the field plus its error.
        margin_rad: largest distance of a star from its predicted place.
        limit_s: the part's time, which is not exceeded.
        largest_false_alarm: highest expected number of false alarms per image.
        passes: searches, one after the other.
    """
    count = len(directions)
    limit = meter.total + round((limit_s - _RESERVE_S) * meter.table.clock_hz)
    if count < STARS_OF_TRIANGLE:
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
    picture = Observation(directions[order], catalogue, field, margin_rad, meter)
    triangles = PairTriangles(catalogue, listed, meter, limit)
    search = AttitudeSearch(limit, largest_false_alarm, SURE)
    best = search.run(_passes(picture, triangles, passes))
    if isinstance(best, Candidate):
        return identified(order[best.centroids], best, count)
    nothing = unidentified(count, best)
    nothing.votes[:] = triangles.entries > 0
    return nothing


def _passes(
    picture: Observation, triangles: PairTriangles, passes: tuple[PairPass, ...]
) -> Iterator[SearchPass]:
    for each in passes:
        observation = picture.mirrored() if each.mirrored else picture
        rays = observation.directions[: each.most]
        steps = triangles.steps(rays, each.part * picture.margin_rad, each.factor)
        yield SearchPass(observation, steps, each.mirrored)
