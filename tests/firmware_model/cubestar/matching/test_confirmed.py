"""Identification by confirmation on random skies; each rate has room for chance."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.field_of_view import FieldOfView
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.confirmed import PairPass, identify
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.matching.pair_triangles import PairTriangles
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.star_tracker.confirmation import volume
from cubestack.firmware_model.star_tracker.observation import LARGEST_FALSE_ALARM
from cubestack.firmware_model.star_tracker.search import MatchOutcome

from ..sky import meter, pinhole

Shoot = Callable[..., Any]
Rays = NDArray[np.float32]


@pytest.fixture(scope="module")
def field() -> FieldOfView:
    return pinhole()


@pytest.fixture(scope="module")
def name(catalogue: StarCatalogue, field: FieldOfView) -> Callable[..., Identification]:
    def identified(directions: Rays, brightness: Any = None, **more: Any) -> Identification:
        return identify(directions, brightness, catalogue, field, more.pop("on", meter()), **more)

    return identified


Name = Callable[..., Identification]


def right(found: Identification, stars: NDArray[np.int64]) -> bool:
    """Whether it is solved; an identity that is wrong fails the test."""
    matched = found.matched
    assert (found.outcome is MatchOutcome.IDENTIFIED) == (len(matched) > 0)
    wrong = int((found.stars[matched] != stars[matched]).sum())
    # A false star may stand within the margin of a real one's place and be nearer to it.
    assert wrong <= max(1, len(matched) // 5)
    return len(matched) > 0


def near(
    boresight: NDArray[np.float64], deg: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    axis: NDArray[np.float64] = np.cross(boresight, rng.normal(size=3))
    turn = Rotation.from_rotvec(np.radians(deg) * axis / np.linalg.norm(axis))
    return np.asarray(turn.apply(boresight), dtype=np.float32)


def random_rays(rng: np.random.Generator, count: int) -> Rays:
    """Unit vectors (count, 3) in the field."""
    rays = np.column_stack([rng.uniform([-0.45, -0.22], [0.45, 0.22], (count, 2)), np.ones(count)])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True), np.float32)


@pytest.mark.parametrize(
    ("hint_deg", "false_stars", "least"),
    [
        *((None, 0, 0.99), (None, 5, 0.98), (None, 10, 0.97), (None, 20, 0.95)),
        *((5.0, 0, 0.99), (5.0, 20, 0.96)),
    ],
)
def test_a_sky_is_solved_and_never_wrong(
    name: Name, shoot: Shoot, hint_deg: float | None, false_stars: int, least: float
) -> None:
    rng = np.random.default_rng((10 if hint_deg is None else 30) + false_stars)
    solved = tries = 0
    while tries < 100:
        shot = shoot(rng, false_stars=false_stars, most=40)
        if np.count_nonzero(shot.stars >= 0) >= 5:
            hint = None if hint_deg is None else near(shot.attitude[2], hint_deg, rng)
            solved += right(name(shot.directions, boresight=hint), shot.stars)
            tries += 1
    assert solved >= least * tries


def test_a_boresight_on_the_far_side_finds_nothing(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(50)
    for _ in range(40):
        shot = shoot(rng)
        hint = -shot.attitude[2].astype(np.float32)
        found = name(shot.directions, boresight=hint)
        assert found.outcome is not MatchOutcome.IDENTIFIED


@pytest.mark.parametrize("count", [3, 5, 10, 20, 40])
def test_false_stars_are_not_identified(name: Name, count: int) -> None:
    rng = np.random.default_rng(60 + count)
    for _ in range(40):
        assert not len(name(random_rays(rng, count)).matched)


def test_the_mirror_image_of_the_sky_is_refused(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(70)
    outcomes = []
    for _ in range(40):
        found = name(shoot(rng).directions * np.array([-1, 1, 1], dtype=np.float32))
        assert not len(found.matched)
        outcomes.append(found.outcome)
    assert outcomes.count(MatchOutcome.MIRRORED) >= 38


def test_three_stars_that_fit_two_places_get_no_identity(field: FieldOfView) -> None:
    rng = np.random.default_rng(80)
    triple = np.array([[0.1, 0.0, 1], [-0.12, 0.05, 1], [0.02, -0.17, 1]])
    triple /= np.linalg.norm(triple, axis=1, keepdims=True)
    twice = np.concatenate([triple, triple @ Rotation.random(random_state=rng).as_matrix().T])
    sky = StarCatalogue.build(np.arange(6), twice, np.ones(6), 3.8, 57.3)
    once = StarCatalogue.build(np.arange(3), triple, np.ones(3), 3.8, 57.3)
    rays = triple.astype(np.float32)
    assert identify(rays, None, once, field, meter()).outcome is MatchOutcome.IDENTIFIED
    assert identify(rays, None, sky, field, meter()).outcome is MatchOutcome.AMBIGUOUS


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_centroids_are_not_enough(name: Name, count: int) -> None:
    found = name(np.tile(np.array([[0, 0, 1]], dtype=np.float32), (count, 1)))
    assert found.outcome is MatchOutcome.TOO_FEW_CENTROIDS
    assert found.stars.tolist() == [-1] * count


def test_the_order_of_the_centroids_does_not_matter(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(81)
    for _ in range(20):
        shot = shoot(rng, false_stars=8, most=40)
        brightness = rng.permutation(len(shot.stars)).astype(float)
        shuffled = rng.permutation(len(shot.stars))
        plain = name(shot.directions, brightness)
        other = name(shot.directions[shuffled], brightness[shuffled])
        assert other.stars.tolist() == plain.stars[shuffled].tolist()
        assert other.false_alarm == pytest.approx(plain.false_alarm, nan_ok=True)


def test_stars_that_were_tried_in_vain_have_votes(name: Name) -> None:
    """Six false stars: each was one of a triangle of the catalogue, and none is believed."""
    rng = np.random.default_rng(11)
    plane = np.column_stack([rng.uniform([-0.4, -0.2], [0.4, 0.2], (6, 2)), np.ones(6)])
    rays = (plane / np.linalg.norm(plane, axis=1)[:, None]).astype(np.float32)
    found = name(rays)
    assert found.outcome is not MatchOutcome.IDENTIFIED
    assert found.votes.any()


def test_false_stars_never_turn_right_into_wrong(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(82)
    for _ in range(30):
        shot = shoot(rng)
        more = np.concatenate([shot.directions, random_rays(rng, 15)])
        found = name(more)
        real = found.stars[: len(shot.stars)]
        assert set(real.tolist()) <= {-1, *shot.stars.tolist()}
        named = real != -1
        assert (real[named] == shot.stars[named]).all()


@pytest.mark.parametrize("per_cent", [-1.0, -0.5, 0.5, 1.0])
def test_another_focal_length_is_found_out(name: Name, shoot: Shoot, per_cent: float) -> None:
    rng = np.random.default_rng(83)
    scale, solved, tries = 1 + per_cent / 100, 0, 0
    while tries < 25:
        shot = shoot(rng)
        if len(shot.stars) >= 6:
            found = name(scaled(shot.directions, scale, meter()))
            solved += right(found, shot.stars)
            tries += 1
            if len(found.matched) >= 5:
                assert found.scale == pytest.approx(scale, abs=0.002)
    assert solved >= 22


@pytest.mark.parametrize("per_cent", [-3.0, -0.85, -0.35, 0.35, 0.85, 3.0])
def test_five_stars_are_enough_for_a_lens_up_to_3_per_cent_off(
    name: Name, shoot: Shoot, per_cent: float
) -> None:
    """So few are only found where one of the focal lengths that are tried is nearly right."""
    rng = np.random.default_rng(86)
    scale, solved, tries = 1 + per_cent / 100, 0, 0
    while tries < 25:
        shot = shoot(rng, noise_rad=0, most=5)
        x, y, z = np.abs(shot.directions.T)
        # Stars at the border would leave the picture.
        if len(shot.stars) == 5 and (x < 0.44 * z).all() and (y < 0.22 * z).all():
            solved += right(name(scaled(shot.directions, scale, meter())), shot.stars)
            tries += 1
    assert solved >= 24


def test_what_the_result_says(name: Name, shoot: Shoot) -> None:
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


def test_it_ends_in_time(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(96)
    for count in (12, 24, 40):
        hard = meter()
        found = name(random_rays(rng, count), on=hard, limit_s=0.25)
        assert CORTEX_M3.seconds(hard.total) <= 0.25
        assert sum(hard.phases.values()) == hard.total
        assert found.outcome in (MatchOutcome.NO_TIME, MatchOutcome.UNCONFIRMED)
    easy, shot = meter(), shoot(rng)
    name(shot.directions, on=easy)
    assert CORTEX_M3.seconds(easy.total) < 0.1


def test_triangles_are_those_that_trying_all_finds(catalogue: StarCatalogue) -> None:
    rng = np.random.default_rng(97)
    tolerance, count = 0.001, 10
    vectors = catalogue.vectors.astype(float)
    listed = np.arccos(np.clip(vectors @ vectors.T, -1, 1))
    np.fill_diagonal(listed, 9.0)
    chance = seen = 0.0
    for _ in range(12):
        rays = random_rays(rng, count)
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
                seen += volume(rays[centroids]) * volume(vectors[stars]) > 0
                found.add(tuple(sorted(zip(centroids.tolist(), stars.tolist(), strict=True))))
        assert len(found ^ wanted) <= 1  # a side at the tolerance may round either way
    assert 0.4 < seen / chance < 1.2  # these stars do not cluster


def test_few_random_pictures_are_believed_and_no_more_than_said(name: Name) -> None:
    rng = np.random.default_rng(98)
    believed = 0
    for _ in range(150):
        loose = name(random_rays(rng, 8), largest_false_alarm=0.05, passes=(PairPass(),))
        believed += len(loose.matched) > 0
    assert believed <= 15  # twice what is said


def test_two_centroids_side_by_side_are_no_one_star(name: Name, shoot: Shoot) -> None:
    rng = np.random.default_rng(99)
    shot = next(s for s in (shoot(rng) for _ in range(20)) if 8 <= len(s.stars) <= 18)
    twin = shot.directions[3] + np.array([3e-4, 0, 0], dtype=np.float32)
    rays = np.vstack([shot.directions, twin / np.linalg.norm(twin)]).astype(np.float32)
    found = name(rays)
    assert sorted(found.stars[found.matched].tolist()) == sorted(shot.stars.tolist())
