"""Identification by confirmation on random skies; each rate has room for chance."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.confirmed import PairPass, identify
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.matching.pair_triangles import PairTriangles
from cubestack.firmware_model.star_tracker.confirmation import volumes
from cubestack.firmware_model.star_tracker.observation import LARGEST_FALSE_ALARM
from cubestack.firmware_model.star_tracker.search import MatchOutcome

from ...star_tracker.trackers import PairTracker
from ..sky import meter, pinhole

Shoot = Callable[..., Any]
Name = Callable[..., Identification]


@pytest.fixture(scope="module")
def tracker(catalogue: StarCatalogue, shoot: Shoot) -> PairTracker:
    return PairTracker(catalogue, shoot)


@pytest.fixture(scope="module")
def name(tracker: PairTracker) -> Name:
    def identified(directions: Any, brightness: Any = None, **more: Any) -> Identification:
        return identify(directions, brightness, tracker.catalogue, tracker.field, meter(), **more)

    return identified


def test_three_stars_that_match_two_places_are_not_identified() -> None:
    rng = np.random.default_rng(80)
    triple = np.array([[0.1, 0.0, 1], [-0.12, 0.05, 1], [0.02, -0.17, 1]])
    triple /= np.linalg.norm(triple, axis=1, keepdims=True)
    twice = np.concatenate([triple, triple @ Rotation.random(random_state=rng).as_matrix().T])
    sky = StarCatalogue.build(np.arange(6), twice, np.ones(6), 3.8, 57.3)
    once = StarCatalogue.build(np.arange(3), triple, np.ones(3), 3.8, 57.3)
    rays = triple.astype(np.float32)
    assert identify(rays, None, once, pinhole(), meter()).outcome is MatchOutcome.IDENTIFIED
    assert identify(rays, None, sky, pinhole(), meter()).outcome is MatchOutcome.AMBIGUOUS


def test_identification_does_not_depend_on_the_centroid_order(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(81)
    for _ in range(20):
        shot = shoot(rng, false_stars=8, most=40)
        brightness = rng.permutation(len(shot.stars)).astype(float)
        shuffled = rng.permutation(len(shot.stars))
        plain = name(shot.directions, brightness)
        other = name(shot.directions[shuffled], brightness[shuffled])
        assert other.stars.tolist() == plain.stars[shuffled].tolist()
        assert other.false_alarm == pytest.approx(plain.false_alarm, nan_ok=True)


def test_rejected_stars_keep_their_votes(name: Name, tracker: PairTracker) -> None:
    """Six false stars: each was one of a triangle of the catalogue, and none is believed."""
    found = name(tracker.false_rays(np.random.default_rng(11), 6))
    assert found.outcome is not MatchOutcome.IDENTIFIED
    assert found.votes.any()


@pytest.mark.parametrize("per_cent", [-3.0, -0.85, -0.35, 0.35, 0.85, 3.0])
def test_five_stars_suffice_at_3_percent_focal_length_error(
    tracker: PairTracker, shoot: Shoot, per_cent: float
) -> None:
    """So few are only found where one of the focal lengths that are tried is nearly right."""
    rng = np.random.default_rng(86)
    scale, solved, tries = 1 + per_cent / 100, 0, 0
    while tries < 25:
        shot = shoot(rng, noise_rad=0, most=5)
        x, y, z = np.abs(shot.directions.T)
        # Stars at the border would leave the picture.
        if len(shot.stars) == 5 and (x < 0.44 * z).all() and (y < 0.22 * z).all():
            found = tracker.identify(scaled(shot.directions, scale, meter()))
            solved += found.is_right(shot.stars)
            tries += 1
    assert solved >= 24


def test_identification_result_has_votes_confidence_and_false_alarm(
    name: Name, shoot: Shoot
) -> None:
    rng = np.random.default_rng(94)
    shot = next(s for s in (shoot(rng) for _ in range(20)) if 8 <= len(s.stars) <= 19)
    found = name(shot.directions)
    assert found.stars.tolist() == shot.stars.tolist()
    assert found.votes.tolist() == [len(shot.stars) - 1] * len(shot.stars)
    assert found.confidence.tolist() == [1.0] * len(shot.stars)
    assert 0 <= found.false_alarm <= LARGEST_FALSE_ALARM
    assert abs(found.expected - len(shot.stars)) <= 1
    assert 0 < float(found.residuals.max()) < 0.0005
    assert found.scale == pytest.approx(1, abs=0.001)


def test_triangles_equal_exhaustive_search(catalogue: StarCatalogue, tracker: PairTracker) -> None:
    rng = np.random.default_rng(97)
    tolerance, count = 0.001, 10
    vectors = catalogue.vectors.astype(float)
    listed = np.arccos(np.clip(vectors @ vectors.T, -1, 1))
    np.fill_diagonal(listed, 9.0)
    chance = seen = 0.0
    for _ in range(6):
        rays = tracker.false_rays(rng, count)
        apart = np.arccos(np.clip(rays.astype(float) @ rays.T.astype(float), -1, 1))
        wanted = set()
        for i, j, k in combinations(range(count), 3):
            a, b = np.nonzero(np.abs(listed - apart[i, j]) <= tolerance)
            for p, q in zip(a, b, strict=True):
                fits = np.abs(listed[p] - apart[i, k]) <= tolerance
                fits &= np.abs(listed[q] - apart[j, k]) <= tolerance
                wanted |= {((i, p), (j, q), (k, r)) for r in np.flatnonzero(fits)}
        found = set()
        for step in PairTriangles(catalogue, None, meter(), 1 << 62).steps(rays, tolerance):
            assert step is not None
            chance += step.by_chance
            for centroids, stars in zip(step.centroids, step.stars, strict=True):
                seen += np.prod(volumes(np.stack([rays[centroids], vectors[stars]]))) > 0
                found.add(tuple(sorted(zip(centroids.tolist(), stars.tolist(), strict=True))))
        assert len(found ^ wanted) <= 1  # a side at the tolerance may round either way
    assert 0.4 < seen / chance < 1.2  # these stars do not cluster


def test_false_solutions_stay_below_the_declared_rate(name: Name, tracker: PairTracker) -> None:
    rng = np.random.default_rng(98)
    believed = 0
    for _ in range(150):
        loose = name(tracker.false_rays(rng, 8), largest_false_alarm=0.05, passes=(PairPass(),))
        believed += len(loose.matched) > 0
    assert believed <= 15  # twice what is said
