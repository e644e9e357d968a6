"""The figures exist and are figures; how good they are is the bench's to tell."""

import numpy as np
import pytest

from cubestack.emulator.rtl import benchmark
from cubestack.emulator.rtl.build import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    "figure", [benchmark.rtl_clocks_per_s, benchmark.strobes_per_s, benchmark.cold_build_s]
)
def test_figures_are_positive(figure, monkeypatch):
    monkeypatch.setattr(benchmark, "ROUNDS", 1)
    assert figure() > 0


def test_the_measured_run_stores_a_frame():
    """The first line is joined in the middle, so the frame begins with the second."""
    _, engine = benchmark._store(skipping=False)
    image = engine.sram[: 1024 * 512].reshape(512, 1024)
    frame = benchmark._Frame(np.roll(image, 1, axis=0))
    assert (engine.get_pin("ACK"), engine.now_ps) == (
        1,
        int((frame.clocks + 1024) * benchmark.PERIOD),
    )
    rng = np.random.default_rng(0)
    assert (frame.image == rng.integers(0, 256, (512, 1024), dtype=np.uint8)).all()
