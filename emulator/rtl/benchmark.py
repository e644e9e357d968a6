"""How fast the compiled engine is, and how long its first build takes."""

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.build import library_for
from cubestack.emulator.rtl.engine import RtlEngine, make_engine
from cubestack.emulator.rtl.wiring import cubestar_wiring
from cubestack.emulator.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS
from cubestack.hdl.cubestar_top import CubeStarTop

__all__ = ["cold_build_s", "rtl_clocks_per_s", "strobes_per_s"]

PERIOD = Fraction(PS_PER_S, CRYSTAL_HZ)
ROUNDS = 5  # the best one counts: the others were disturbed


@dataclass(frozen=True)
class _Frame:
    """The same frame for ever, with no blanking: every clock has work to do."""

    image: NDArray[np.uint8]
    number: int = 0
    period: Fraction = PERIOD
    line_clocks: int = LINE_CLOCKS
    vsync: int = 1

    @property
    def rows(self) -> int:
        return len(self.image)

    @property
    def active_columns(self) -> int:
        return len(self.image[0])

    @property
    def clocks(self) -> int:
        return self.rows * self.line_clocks

    @property
    def start_ps(self) -> int:
        return int(self.number * self.clocks * self.period)

    @property
    def pixels(self) -> Callable[[], NDArray[np.uint8]]:
        return lambda: self.image

    def segment_at(self, time_ps: int) -> "_Frame":
        return _Frame(self.image, int(time_ps / (self.clocks * self.period)))


def rtl_clocks_per_s() -> float:
    """Pixel clocks for each second of wall time while a full frame is stored, none skipped."""
    return max(_store(skipping=False)[0] for _ in range(ROUNDS))


def strobes_per_s() -> float:
    """Data clock cycles for each second of wall time while that frame is read back."""
    _, engine = _store(skipping=True)
    engine.set_pin("ENABLE", 0)
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    engine.run(engine.now_ps + 1_000_000)
    out = np.empty(len(engine.sram) // 2, np.uint8)
    best = 0.0
    for _ in range(ROUNDS):
        start = time.perf_counter()
        period = Fraction(1_000_000)
        cycles = engine.strobe_read(out, period, engine.now_ps + len(out) * int(period))
        best = max(best, cycles / (time.perf_counter() - start))
    return best


def cold_build_s() -> float:
    """Wall time from a design to its shared library, with nothing in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        library_for(cubestar_wiring(), Path(folder))
        return time.perf_counter() - start


def _store(*, skipping: bool) -> tuple[float, RtlEngine]:
    top = CubeStarTop()
    engine = make_engine(top, "compiled", skipping=skipping)
    rng = np.random.default_rng(0)
    engine.attach(_Frame(rng.integers(0, 256, (top.rows, top.columns), dtype=np.uint8)))
    engine.set_pin("ENABLE", 1)
    frame_ps = int(top.rows * LINE_CLOCKS * PERIOD)
    start = time.perf_counter()
    reached = engine.run(2 * frame_ps, ("ACK", 1))
    wall_s = time.perf_counter() - start
    return float(reached / PERIOD) / wall_s, engine
