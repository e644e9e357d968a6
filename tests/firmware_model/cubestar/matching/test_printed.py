"""Algorithm 2 and tracking as the thesis prints them, beside the same written out loop by loop."""

from collections import Counter
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.tracking import REACH_DEG, track
from cubestack.firmware_model.cubestar.matching.voting import (
    CUT_RADIUS_DEG,
    DEFAULT_MARGIN_RAD,
    identify,
)
from cubestack.firmware_model.star_tracker.search import MatchOutcome
from tests.tiers import quick

from ..sky import meter, pinhole

Shoot = Callable[..., Any]


def angle(one: NDArray[Any], other: NDArray[Any]) -> float:
    return float(np.arccos(np.clip(np.dot(one.astype(float), other.astype(float)), -1, 1)))


def algorithm_2(directions: NDArray[Any], catalogue: StarCatalogue) -> dict[int, int]:
    """Star of each kept centroid, from sections 4.3.3 and 4.3.4."""
    listed, count = catalogue.pairs, len(directions)
    lists: list[Counter[int]] = [Counter() for _ in range(count)]
    for i, j in combinations(range(count), 2):
        near = np.abs(listed.angle - angle(directions[i], directions[j])) <= DEFAULT_MARGIN_RAD
        for star in (*listed.first[near].tolist(), *listed.second[near].tolist()):
            lists[i][star] += 1
            lists[j][star] += 1
    named = {
        i: min(star for star in votes if votes[star] == max(votes.values()))
        for i, votes in enumerate(lists)
        if votes
    }
    confirmed = Counter[int]()
    for i, j in combinations(named, 2):
        apart = angle(catalogue.vectors[named[i]], catalogue.vectors[named[j]])
        if abs(apart - angle(directions[i], directions[j])) <= DEFAULT_MARGIN_RAD:
            confirmed.update((i, j))
    most = max(confirmed.values(), default=0)
    return {i: star for i, star in named.items() if confirmed[i] >= most - 1}


@pytest.mark.parametrize(("false_stars", "seen"), quick([(10, 20), (0, 20), (10, 5), (3, 20)], 1))
def test_matching_agrees_with_the_printed_voting_algorithm(
    catalogue: StarCatalogue, shoot: Shoot, false_stars: int, seen: int
) -> None:
    rng = np.random.default_rng(false_stars)
    same = 0
    for _ in range(15):
        directions = rng.permutation(shoot(rng, false_stars=false_stars).directions)[:seen]
        found = identify(directions, catalogue, meter())
        kept = algorithm_2(directions, catalogue)
        assert (found.outcome is MatchOutcome.IDENTIFIED) == (len(kept) >= 3)
        same += {i: int(found.stars[i]) for i in found.matched} == (kept if len(kept) >= 3 else {})
    assert same >= 14  # an angle at the margin may round either way


def test_printed_tracking_takes_the_nearest_star(catalogue: StarCatalogue, shoot: Shoot) -> None:
    shot = shoot(np.random.default_rng(2), false_stars=0)
    attitude = shot.attitude.astype(np.float32)
    directions = shot.directions.copy()
    # A centroid that stands 0.2 deg beside its star contradicts all others, and is taken for it.
    aside = directions[0] + np.float32(np.radians(0.2)) * np.cross(directions[0], directions[1])
    directions[0] = aside / np.linalg.norm(aside)
    assert np.degrees(angle(directions[0], shot.directions[0])) < REACH_DEG
    as_printed = track(directions, catalogue, attitude, meter())
    assert as_printed.stars.tolist() == shot.stars.tolist()
    assert as_printed.votes.tolist() == [1] * len(directions)
    field = pinhole()
    verified = track(directions, catalogue, attitude, meter(), field=field)
    assert 0 not in verified.matched


def test_catalogue_cut_radius_is_field_radius_plus_hint_error() -> None:
    assert CUT_RADIUS_DEG == 30 + 5  # sections 4.3.4, 5.3.4


def test_three_matching_stars_suffice_and_two_do_not(catalogue: StarCatalogue) -> None:
    """Three that agree are an identification (section 4.3.5), two are none."""
    near = np.argsort(-catalogue.vectors @ catalogue.vectors[0])[:40]
    for stars in combinations(near.tolist(), 3):
        found = identify(catalogue.vectors[list(stars)], catalogue, meter())
        if found.outcome is MatchOutcome.IDENTIFIED:
            break
    else:
        pytest.fail("no three stars were identified")
    assert len(found.matched) == 3
    two = identify(catalogue.vectors[list(stars[:2])], catalogue, meter())
    assert two.outcome is MatchOutcome.TOO_FEW_CENTROIDS
