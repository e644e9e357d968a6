"""Tracking and verification on random skies; each rate has room for chance."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    CentroidPairs,
    Identification,
    verify,
)
from cubestack.firmware_model.cubestar.matching.tracking import _nearest, track
from cubestack.firmware_model.star_tracker.search import MatchOutcome

from ..sky import meter, pinhole

Shoot = Callable[..., Any]


def check(found: Identification, stars: NDArray[np.int64]) -> tuple[bool, int]:
    matched = found.matched
    wrong = int((found.stars[matched] != stars[matched]).sum())
    assert (found.outcome is MatchOutcome.IDENTIFIED) == (len(matched) > 0)
    assert len(set(found.stars[matched].tolist())) == len(matched)
    return found.outcome is MatchOutcome.IDENTIFIED, wrong


def full_shot(shoot: Shoot, seed: int) -> Any:
    """The first one with at least 8 stars."""
    rng = np.random.default_rng(seed)
    return next(s for s in (shoot(rng) for _ in range(20)) if len(s.stars) >= 8)


def solved(results: list[tuple[bool, int]], least: float) -> bool:
    """Whether at least this share is solved, with at most one wrong identity in total."""
    rate = np.mean([identified for identified, _ in results])
    return bool(rate >= least) and sum(wrong for _, wrong in results) <= 1


@pytest.mark.parametrize(("turn_deg", "apart_s"), [(0.0, 1.0), (0.25, 1.0), (0.38, 1.4)])
def test_tracking_follows_small_rotations(
    catalogue: StarCatalogue, shoot: Shoot, turn_deg: float, apart_s: float
) -> None:
    rng = np.random.default_rng(90)
    results = []
    for _ in range(100):
        shot = shoot(rng, false_stars=3)
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(np.radians(turn_deg) * axis / np.linalg.norm(axis))
        last = (turn.as_matrix() @ shot.attitude).astype(np.float32)
        found = track(shot.directions, catalogue, last, meter(), field=pinhole(), apart_s=apart_s)
        results.append(check(found, shot.stars))
    assert solved(results, 0.99)


@pytest.mark.parametrize("apart_s", [1.0, 30.0])
def test_tracking_is_lost_beyond_its_reach(
    catalogue: StarCatalogue, shoot: Shoot, apart_s: float
) -> None:
    rng = np.random.default_rng(91)
    lost = 0
    for _ in range(40):
        shot = shoot(rng)
        turn = Rotation.from_rotvec(np.radians([1.0, 0, 0])).as_matrix()
        last = (turn @ shot.attitude).astype(np.float32)
        found = track(shot.directions, catalogue, last, meter(), field=pinhole(), apart_s=apart_s)
        lost += found.outcome is not MatchOutcome.IDENTIFIED
    assert lost >= 38


def test_two_stars_suffice_when_two_are_predicted(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(92)
    shot = next(s for s in (shoot(rng) for _ in range(99)) if len(s.stars) >= 4)
    two = catalogue.vectors[shot.stars[:2]].astype(float)
    sky = StarCatalogue.build(np.arange(2), two, np.ones(2), 3.8, 60)
    attitude = shot.attitude.astype(np.float32)
    for known, solved in ((sky, True), (catalogue, False)):
        found = track(shot.directions[:2], known, attitude, meter(), field=pinhole())
        assert (found.outcome is MatchOutcome.IDENTIFIED) == solved
        assert found.votes.tolist() == [solved] * 2
    one = track(shot.directions[:1], catalogue, attitude, meter())
    assert one.outcome is MatchOutcome.TOO_FEW_CENTROIDS


def test_tracking_from_a_wrong_attitude_identifies_nothing(
    catalogue: StarCatalogue, shoot: Shoot
) -> None:
    rng = np.random.default_rng(93)
    for _ in range(300):
        shot = shoot(rng, false_stars=15, most=40)
        elsewhere = Rotation.random(random_state=rng).as_matrix().astype(np.float32)
        found = track(shot.directions, catalogue, elsewhere, meter(), field=pinhole())
        assert found.outcome is not MatchOutcome.IDENTIFIED


def test_tracking_matches_the_nearest_of_several_stars() -> None:
    places = np.radians([[0.0, 0.0], [0.2, 0.0], [9.0, 3.0], [-8.0, -4.0]])
    stars = np.column_stack([np.tan(places), np.ones(4)])
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    sky = StarCatalogue.build(np.arange(4), stars, np.ones(4), 3.8, 57.3)
    seen = stars[[1, 2, 3]].astype(np.float32)
    found = track(seen, sky, np.eye(3, dtype=np.float32), meter(), field=pinhole())
    assert found.stars.tolist() == [1, 2, 3]


def test_verification_keeps_only_a_consistent_set_of_stars(
    catalogue: StarCatalogue, shoot: Shoot
) -> None:
    shot = full_shot(shoot, 93)
    wrong = shot.stars.astype(np.int32)
    wrong[0] = (wrong[0] + 50) % 405
    wrong[1] = wrong[2]
    pairs = CentroidPairs.measure(shot.directions, meter())
    votes, kept = verify(pairs, wrong, catalogue.vectors, 0.001, meter(), thinned=True)
    assert kept[:2].tolist() == [-1, -1]
    assert kept[2:].tolist() == shot.stars[2:].tolist()
    assert set(votes[2:].tolist()) == {len(wrong) - 3}


def test_nearest_star_search_charges_every_pair(catalogue: StarCatalogue) -> None:
    """A star is turned: 9 products, 6 sums. A pair: 3 differences, 3 squares, 2 sums, and one
    comparison."""

    def charged(centroids: int, candidates: int) -> Counter[str]:
        own = meter()
        stars = np.arange(candidates, dtype=np.uint16)
        _nearest(catalogue.vectors[:centroids], catalogue.vectors, stars, np.eye(3), 0.01, own)
        return own.counts

    star = {"flash_read": 3, "f32_mul": 9, "f32_add": 6, "loop": 1}
    pair = {"f32_mul": 3, "f32_add": 3 + 2, "f32_compare": 1, "loop": 1}
    for centroids, candidates in ((1, 1), (2, 1), (1, 2), (7, 60)):
        pairs = centroids * candidates
        assert charged(centroids, candidates) == {
            name: star.get(name, 0) * candidates + pair.get(name, 0) * pairs for name in star | pair
        }
