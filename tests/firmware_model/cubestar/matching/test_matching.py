"""Voting, assisted match and tracking on random skies; each rate has room for chance."""

from collections.abc import Callable
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    CentroidPairs,
    Identification,
    MatchOutcome,
    verify,
)
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.cubestar.matching.voting import (
    LARGEST_CHANCE,
    expected_coincidences,
    identify,
)
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3

from ..sky import meter

Shoot = Callable[..., Any]


def check(found: Identification, stars: NDArray[np.int64]) -> tuple[bool, int]:
    """Whether it is solved, and how many kept identities are wrong."""
    matched = found.matched
    wrong = int((found.stars[matched] != stars[matched]).sum())
    assert (found.outcome is MatchOutcome.IDENTIFIED) == (len(matched) > 0)
    assert len(set(found.stars[matched].tolist())) == len(matched)
    return found.outcome is MatchOutcome.IDENTIFIED, wrong


def near(
    boresight: NDArray[np.float64], deg: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    axis: NDArray[np.float64] = np.cross(boresight, rng.normal(size=3))
    turn = Rotation.from_rotvec(np.radians(deg) * axis / np.linalg.norm(axis))
    return np.asarray(turn.apply(boresight), dtype=np.float32)


def full_shot(shoot: Shoot, seed: int) -> Any:
    """The first one with at least 8 stars."""
    rng = np.random.default_rng(seed)
    return next(s for s in (shoot(rng) for _ in range(20)) if len(s.stars) >= 8)


def random_rays(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3) in the field."""
    rays = np.column_stack([rng.uniform([-0.45, -0.22], [0.45, 0.22], (count, 2)), np.ones(count)])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def solved(results: list[tuple[bool, int]], least: float) -> bool:
    """Whether so large a part is solved, and at most one identity wrong in all."""
    rate = np.mean([identified for identified, _ in results])
    return bool(rate >= least) and sum(wrong for _, wrong in results) <= 1


@pytest.mark.parametrize(
    ("hint_deg", "false_stars", "least"),
    [
        *((None, 0, 0.95), (None, 1, 0.93), (None, 5, 0.88), (None, 10, 0.8)),
        *((5.0, 0, 0.98), (5.0, 10, 0.93)),  # a rough boresight helps
    ],
)
def test_a_sky_is_solved_and_never_wrong(
    catalogue: StarCatalogue, shoot: Shoot, hint_deg: float | None, false_stars: int, least: float
) -> None:
    rng = np.random.default_rng((10 if hint_deg is None else 30) + false_stars)
    results = []
    for _ in range(150):
        shot = shoot(rng, false_stars=false_stars)
        if hint_deg is None:
            found = identify(shot.directions, catalogue, meter())
        else:
            hint = near(shot.attitude[2], hint_deg, rng)
            found = identify(shot.directions, catalogue, meter(), boresight=hint)
        results.append(check(found, shot.stars))
    assert solved(results, least)


def test_repeated_voting_finds_few_among_many_false(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(99)
    results: list[tuple[bool, int]] = []
    while len(results) < 120:
        shot = shoot(rng, false_stars=14)
        if 6 <= np.count_nonzero(shot.stars >= 0) <= 8:
            found = identify(shot.directions, catalogue, meter())
            results.append(check(found, shot.stars))
    assert solved(results, 0.85)  # one round alone solves half


def test_a_boresight_on_the_far_side_finds_nothing(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(50)
    for _ in range(60):
        shot = shoot(rng)
        hint = -shot.attitude[2].astype(np.float32)
        found = identify(shot.directions, catalogue, meter(), boresight=hint)
        assert found.outcome is not MatchOutcome.IDENTIFIED


@pytest.mark.parametrize("count", [3, 5, 10, 20])
def test_false_stars_are_not_identified(catalogue: StarCatalogue, shoot: Shoot, count: int) -> None:
    rng = np.random.default_rng(60 + count)
    solved = 0
    for _ in range(150):
        found = identify(random_rays(rng, count).astype(np.float32), catalogue, meter())
        solved += found.outcome is MatchOutcome.IDENTIFIED
    assert solved <= 3


def test_the_mirror_image_of_the_sky_is_refused(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(70)
    outcomes = []
    for _ in range(40):
        shot = shoot(rng)
        mirrored = shot.directions * np.array([-1, 1, 1], dtype=np.float32)
        outcomes.append(identify(mirrored, catalogue, meter()).outcome)
    assert MatchOutcome.IDENTIFIED not in outcomes
    assert outcomes.count(MatchOutcome.MIRRORED) > 30


def test_three_stars_that_fit_two_places_get_no_identity() -> None:
    rng = np.random.default_rng(80)
    triple = np.array([[0.1, 0.0, 1], [-0.12, 0.05, 1], [0.02, -0.17, 1]])
    triple /= np.linalg.norm(triple, axis=1, keepdims=True)
    twice = np.concatenate([triple, triple @ Rotation.random(random_state=rng).as_matrix().T])
    sky = StarCatalogue.build(np.arange(6), twice, np.ones(6), 3.8, 57.3)
    once = StarCatalogue.build(np.arange(3), triple, np.ones(3), 3.8, 57.3)
    rays = triple.astype(np.float32)
    assert identify(rays, once, meter()).outcome is MatchOutcome.IDENTIFIED
    assert identify(rays, sky, meter()).outcome is MatchOutcome.TOO_FEW_MATCHED


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_centroids_are_not_enough(catalogue: StarCatalogue, count: int) -> None:
    rays = np.tile(np.array([[0, 0, 1]], dtype=np.float32), (count, 1))
    found = identify(rays, catalogue, meter())
    assert found.outcome is MatchOutcome.TOO_FEW_CENTROIDS
    assert found.stars.tolist() == [-1] * count


@pytest.mark.parametrize("turn_deg", [0.0, 0.25])
def test_tracking_follows(catalogue: StarCatalogue, shoot: Shoot, turn_deg: float) -> None:
    rng = np.random.default_rng(90)
    results = []
    for _ in range(100):
        shot = shoot(rng, false_stars=3)
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(np.radians(turn_deg) * axis / np.linalg.norm(axis))
        last = (turn.as_matrix() @ shot.attitude).astype(np.float32)
        results.append(check(track(shot.directions, catalogue, last, meter()), shot.stars))
    assert solved(results, 0.99)


def test_tracking_loses_a_turn_beyond_its_reach(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(91)
    lost = 0
    for _ in range(40):
        shot = shoot(rng)
        turn = Rotation.from_rotvec(np.radians([1.0, 0, 0])).as_matrix()
        last = (turn @ shot.attitude).astype(np.float32)
        found = track(shot.directions, catalogue, last, meter())
        lost += found.outcome is not MatchOutcome.IDENTIFIED
    assert lost >= 38


def test_tracking_needs_two_stars_only(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(92)
    shot = next(s for s in (shoot(rng, most=2) for _ in range(20)) if len(s.stars) == 2)
    found = track(shot.directions, catalogue, shot.attitude.astype(np.float32), meter())
    assert found.stars.tolist() == shot.stars.tolist()
    assert found.votes.tolist() == [1, 1]
    one = track(shot.directions[:1], catalogue, shot.attitude.astype(np.float32), meter())
    assert one.outcome is MatchOutcome.TOO_FEW_CENTROIDS


def test_tracking_takes_the_nearest_of_several_stars_in_reach() -> None:
    places = np.radians([[0.0, 0.0], [0.2, 0.0], [9.0, 3.0], [-8.0, -4.0]])
    stars = np.column_stack([np.tan(places), np.ones(4)])
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    sky = StarCatalogue.build(np.arange(4), stars, np.ones(4), 3.8, 57.3)
    seen = stars[[1, 2, 3]].astype(np.float32)
    found = track(seen, sky, np.eye(3, dtype=np.float32), meter())
    assert found.stars.tolist() == [1, 2, 3]


def test_verification_keeps_a_set_that_agrees(catalogue: StarCatalogue, shoot: Shoot) -> None:
    shot = full_shot(shoot, 93)
    wrong = shot.stars.astype(np.int32)
    wrong[0] = (wrong[0] + 50) % 405
    wrong[1] = wrong[2]
    pairs = CentroidPairs.measure(shot.directions, meter())
    votes, kept = verify(pairs, wrong, catalogue.vectors, 0.001, meter())
    assert kept[:2].tolist() == [-1, -1]
    assert kept[2:].tolist() == shot.stars[2:].tolist()
    assert set(votes[2:].tolist()) == {len(wrong) - 3}


def test_two_centroids_never_share_a_star(catalogue: StarCatalogue, shoot: Shoot) -> None:
    shot = full_shot(shoot, 98)
    twin = shot.directions[3] + np.array([3e-4, 0, 0], dtype=np.float32)
    rays = np.vstack([shot.directions, twin / np.linalg.norm(twin)]).astype(np.float32)
    last = shot.attitude.astype(np.float32)
    for found in (identify(rays, catalogue, meter()), track(rays, catalogue, last, meter())):
        given = found.stars[found.matched].tolist()
        assert sorted(given) == sorted(shot.stars.tolist())


def test_votes_and_confidence_of_a_clean_picture(catalogue: StarCatalogue, shoot: Shoot) -> None:
    shot = full_shot(shoot, 94)
    found = identify(shot.directions, catalogue, meter())
    assert found.votes.tolist() == [len(shot.stars) - 1] * len(shot.stars)
    assert found.confidence.tolist() == [1.0] * len(shot.stars)


def test_chance_agreements_are_as_frequent_as_expected(catalogue: StarCatalogue) -> None:
    """Count the triples of random points that agree with the catalogue, by brute force."""
    rng = np.random.default_rng(95)
    margin, count, trials = 0.003, 6, 60
    angles = catalogue.pairs.angle
    table = np.arccos(np.clip(catalogue.vectors.astype(float) @ catalogue.vectors.T, -1, 1))
    seen = expected = 0.0
    for _ in range(trials):
        rays = random_rays(rng, count)
        apart = np.arccos(np.clip(rays @ rays.T, -1, 1))
        i, j = np.triu_indices(count, 1)
        low, high = (np.searchsorted(angles, apart[i, j] + s * margin) for s in (-1, 1))
        looked_up = int((high - low).sum())
        expected += expected_coincidences(count, 3, looked_up, 405 / (4 * np.pi), margin)
        for a, b, c in combinations(range(count), 3):
            first, second = np.nonzero(np.abs(table - apart[a, b]) <= margin)
            agree = np.abs(table[first] - apart[a, c]) <= margin
            agree &= np.abs(table[second] - apart[b, c]) <= margin
            seen += agree.sum() / 2  # half of them are mirror images
    assert 0.5 < seen / expected < 2.0


def test_more_agreeing_stars_are_less_likely_by_chance() -> None:
    odds = [expected_coincidences(20, m, 7500, 32.0, 0.001) for m in range(3, 8)]
    assert all(b < a / 20 for a, b in pairwise(odds))
    assert odds[0] > LARGEST_CHANCE > odds[2]


def test_the_charge_is_that_of_the_work_done(catalogue: StarCatalogue, shoot: Shoot) -> None:
    rng = np.random.default_rng(96)
    shot = next(s for s in (shoot(rng, false_stars=20) for _ in range(20)) if len(s.stars) == 20)
    full, half, cut = meter(), meter(), meter()
    identify(shot.directions, catalogue, full)
    identify(shot.directions[:10], catalogue, half)
    identify(shot.directions, catalogue, cut, boresight=shot.attitude[2].astype(np.float32))
    assert 190 <= full.counts["f32_acos"] <= 2 * 190
    assert 45 <= half.counts["f32_acos"] <= 2 * 45
    assert full.phases["votes"] > 2.5 * half.phases["votes"]
    assert cut.phases["votes"] < full.phases["votes"]
    assert sum(full.phases.values()) == full.total
    assert CORTEX_M3.seconds(full.total) < 0.5


def test_a_wider_margin_looks_up_and_charges_more(catalogue: StarCatalogue, shoot: Shoot) -> None:
    shot = shoot(np.random.default_rng(97))
    tight, loose = meter(), meter()
    identify(shot.directions, catalogue, tight, margin_rad=0.0005)
    identify(shot.directions, catalogue, loose, margin_rad=0.002)
    assert loose.phases["votes"] > 1.5 * tight.phases["votes"]
