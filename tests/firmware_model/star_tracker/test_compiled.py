"""The compiled loops equal the Python form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.star_tracker.background import estimate, sample_offsets
from cubestack.firmware_model.star_tracker.regions import Runs
from tests.firmware_model.compiled import assert_equal_forms

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(1, 150), st.integers(1, 150), st.sampled_from([2, 4]), st.booleans())
def test_background_and_thresholds(
    seed: int, rows: int, columns: int, step: int, smooth: bool
) -> None:
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.integers(0, 257, 2))
    slope = rng.uniform(-3, 3) * np.arange(columns)
    noise = rng.integers(low, high + 1, (rows, columns))
    picture = np.clip(noise + slope, 0, 255).astype(np.uint8)
    least = int(rng.integers(0, 400))

    def compute(_meter: object) -> object:
        down, across = sample_offsets(rows, columns, step)
        sky = estimate(picture[np.ix_(down, across)], step, 5 * step)
        sky = sky.smoothed() if smooth else sky
        return [sky, *(sky.brighter(picture, s, least) for s in (4, 2.0, 3.7, -1.5))]

    assert_equal_forms(compute, CORTEX_M3)


@given(SEEDS, st.integers(1, 60), st.integers(1, 90), st.floats(0, 1))
def test_runs_and_their_regions(seed: int, rows: int, columns: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    bright = rng.random((rows, columns + 1)) < share
    bright[:, -1] = False

    def compute(_meter: object) -> object:
        runs = Runs.of(bright[:, :-1], gap=1)
        assert np.array_equal([runs.begins, runs.ends], [*vars(Runs.of(bright)).values()])
        left = runs.without(runs.places()[::3])
        return runs, left, runs.join(columns + 1), left.join(columns + 1)

    assert_equal_forms(compute, CORTEX_M3)


def test_more_runs_than_there_was_room_for() -> None:
    bright = np.tile([True, False], 50_000).reshape(100, -1)
    assert_equal_forms(lambda _: (Runs.of(bright), Runs.of(bright).join(1000)), CORTEX_M3)
