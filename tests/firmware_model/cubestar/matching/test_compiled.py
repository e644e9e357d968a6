"""The compiled search for triangles equals the Python form, in results and charges."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching import pair_triangles, voting
from cubestack.firmware_model.cubestar.matching.confirmed import PairPass, identify
from cubestack.firmware_model.cubestar.matching.pair_triangles import PairTriangles
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import matched
from tests.firmware_model.compiled import assert_equal_forms

from ..sky import pinhole

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")

SEEDS = st.integers(0, 2**32 - 1)
Shoot = Callable[..., Any]


def rays(rng: np.random.Generator, count: int, width: float) -> np.ndarray:
    """Unit vectors (count, 3) about the boresight, some of them the same."""
    places = rng.uniform(-width, width, (count, 2))
    places[rng.integers(0, count, count // 4)] = places[0]
    directions = np.column_stack([places, np.ones(count)])
    return (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)


@settings(max_examples=60)
@given(SEEDS, st.integers(0, 12), st.booleans(), st.sampled_from([0.25, 0.05, 0.019, 0.02]))
def test_identification(
    catalogue: StarCatalogue, shoot: Shoot, seed: int, false: int, near: bool, limit_s: float
) -> None:
    rng = np.random.default_rng(seed)
    shot = shoot(rng, false_stars=false, most=40)
    brightness = rng.integers(0, 5, len(shot.directions))
    boresight = shot.attitude[2].astype(np.float32) if near else None
    passes = PairPass(most=24), PairPass(most=10, mirrored=True), PairPass(1.01, part=1.0)

    def compute(meter: Meter) -> object:
        return identify(
            *(shot.directions, brightness, catalogue, pinhole(), meter),
            boresight=boresight,
            limit_s=limit_s,
            passes=passes,
        )

    assert_equal_forms(compute, CORTEX_M3)


@settings(max_examples=40)
@given(SEEDS, st.integers(0, 12), st.booleans(), st.floats(0, 0.01))
def test_voting(
    catalogue: StarCatalogue, shoot: Shoot, seed: int, false: int, near: bool, margin: float
) -> None:
    shot = shoot(np.random.default_rng(seed), false_stars=false)
    boresight = shot.attitude[2].astype(np.float32) if near else None

    def compute(meter: Meter) -> object:
        given = shot.directions, catalogue, meter
        return voting.identify(*given, boresight=boresight, margin_rad=margin)

    assert_equal_forms(compute, CORTEX_M3)


@settings(max_examples=30)
@given(SEEDS, st.integers(0, 14), st.floats(1e-5, 0.02), st.floats(0, 1))
def test_steps_of_a_pass(
    catalogue: StarCatalogue, seed: int, count: int, tolerance: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    directions = rays(rng, count, 0.4) if count else np.zeros((0, 3), np.float32)
    listed = None if share > 0.5 else rng.random(len(catalogue)) < 2 * share

    def compute(meter: Meter) -> object:
        limit = int(10 ** np.random.default_rng(seed).uniform(3, 8))
        triangles = PairTriangles(catalogue, listed, meter, limit)
        return [list(triangles.steps(directions, tolerance, 1.01)), triangles.entries]

    assert_equal_forms(compute, CORTEX_M3)


def test_more_triangles_than_there_was_room_for(
    catalogue: StarCatalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_triangles, "_ROOM", 1)
    directions = rays(np.random.default_rng(5), 8, 0.2)

    def compute(meter: Meter) -> object:
        return list(PairTriangles(catalogue, None, meter, 10**9).steps(directions, 0.01))

    steps = assert_equal_forms(compute, CORTEX_M3)
    assert isinstance(steps, list)
    assert max(len(step.shares) for step in steps if step is not None) > 1


@given(SEEDS, st.integers(0, 20), st.integers(0, 20), st.floats(0, 0.2))
def test_nearest_stars(seed: int, count: int, predicted: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    here, there = (
        rays(rng, size, 0.1) if size else np.zeros((0, 3), np.float32)
        for size in (count, predicted)
    )
    there[: min(count, predicted) // 2] = here[: min(count, predicted) // 2]
    assert_equal_forms(lambda meter: matched(here, there, radius, meter), CORTEX_M3)
