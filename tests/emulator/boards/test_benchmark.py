"""The figures exist and are figures; how good they are is the benchmark's to tell."""

from fractions import Fraction
from math import ceil

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense import benchmark as pair
from cubestack.emulator.boards.cubestar import benchmark as star
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.benchmark import cold_build_s
from cubestack.firmware_model.interface.cameras.mlx75412 import LINE_CLOCKS
from cubestack.firmware_model.interface.cameras.ov7620 import PIXEL_CLOCK_HZ
from tests.tiers import quick_ones

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    "figure",
    [
        lambda: star.rtl_clocks_per_s(1),
        lambda: star.strides_per_s(1),
        lambda: star.strobes_per_s(1),
        pytest.param(lambda: cold_build_s(cubestar_wiring()), marks=pytest.mark.slow),
        lambda: pair.pair_scan_ms(pair.pair_with_cameras(), 1),
    ],
)
def test_board_benchmark_figures_are_positive(figure):
    assert 0 < figure() < float("inf")


def test_benchmark_run_stores_a_frame():
    """The first line is joined in the middle, so the frame begins with the second."""
    _, engine = star.stored_frame(skipping=False)
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 256, (512, 1024), dtype=np.uint8)
    assert (engine.sram[: 1024 * 512].reshape(512, 1024) == np.roll(frame, -1, axis=0)).all()
    ends = int((512 * LINE_CLOCKS + 1024) * star.PERIOD)
    assert (engine.get_pin("ACK"), engine.now_ps) == (1, ends)


@pytest.mark.parametrize("way", quick_ones(pair.STORES, "both"))
def test_benchmark_pair_stores_end_with_the_frame(way):
    engine = pair.pair_with_cameras()
    assert 0 < pair.pair_store_ms(engine, way, 2) < float("inf")
    assert all(engine.get_pin(pin) for pin in pair.STORES[way][1])
    clocks = ceil(engine.now_ps / Fraction(10**12, PIXEL_CLOCK_HZ))
    assert -clocks % (525 * 858) == 218  # the last line's blanking is still to come
