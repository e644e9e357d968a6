"""The figures exist and are figures; how good they are is the bench's to tell."""

from fractions import Fraction
from functools import partial
from math import ceil

import numpy as np
import pytest

from cubestack.emulator.rtl import benchmark
from cubestack.emulator.rtl.cxxrtl.build import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    "figure",
    [
        benchmark.rtl_clocks_per_s,
        benchmark.strobes_per_s,
        benchmark.cold_build_s,
        benchmark.pair_scan_ms,
        *(partial(benchmark.pair_store_ms, way) for way in benchmark.PAIR_STORES),
    ],
)
def test_figures_are_positive(figure, monkeypatch):
    monkeypatch.setattr(benchmark, "ROUNDS", 1)
    assert 0 < figure() < float("inf")


def test_the_measured_run_stores_a_frame():
    """The first line is joined in the middle, so the frame begins with the second."""
    _, engine = benchmark._store(skipping=False)
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 256, (512, 1024), dtype=np.uint8)
    assert (engine.sram[: 1024 * 512].reshape(512, 1024) == np.roll(frame, -1, axis=0)).all()
    ends = int((512 * benchmark.LINE_CLOCKS + 1024) * benchmark.PERIOD)
    assert (engine.get_pin("ACK"), engine.now_ps) == (1, ends)


@pytest.mark.parametrize("way", benchmark.PAIR_STORES)
def test_the_measured_stores_of_the_pair_end_with_the_frame(way, monkeypatch):
    engine = benchmark._pair()
    monkeypatch.setattr(benchmark, "ROUNDS", 2)
    monkeypatch.setattr(benchmark, "_pair", lambda: engine)
    benchmark.pair_store_ms(way)
    _, acknowledges = benchmark.PAIR_STORES[way]
    assert all(engine.get_pin(pin) for pin in acknowledges)
    clocks = ceil(engine.now_ps / Fraction(10**12, benchmark.PIXEL_CLOCK_HZ))
    assert -clocks % (525 * 858) == 218  # the last line's blanking is still to come
