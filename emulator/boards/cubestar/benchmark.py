"""Measures the compiled engine with CubeStar's FPGA."""

import time
from fractions import Fraction

import numpy as np

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.benchmark import ROUNDS, RepeatedFrame
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS
from cubestack.firmware_model.interface.cubestar.pins import ACK, ENABLE, RNW
from cubestack.hdl.cubestar.top import CubeStarTop

PERIOD = Fraction(PS_PER_S, CRYSTAL_HZ)


def rtl_clocks_per_s(rounds: int = ROUNDS) -> float:
    """Pixel clocks per second of wall time while a full frame is stored, none skipped."""
    return max(stored_frame(skipping=False)[0] for _ in range(rounds))


def strides_per_s(rounds: int = ROUNDS) -> float:
    """The same with the design's strides, skipping clocks that change nothing."""
    return max(stored_frame(skipping=True)[0] for _ in range(rounds))


def strobes_per_s(rounds: int = ROUNDS) -> float:
    """Data clock cycles per second of wall time while that frame is read back."""
    _, engine = stored_frame(skipping=True)
    engine.set_pin(ENABLE, 0)
    engine.set_pin(RNW, 1)
    engine.set_pin(ENABLE, 1)
    engine.run(engine.now_ps + 1_000_000)
    out = np.empty(len(engine.sram) // 2, np.uint8)
    best = 0.0
    for _ in range(rounds):
        start = time.perf_counter()
        period = Fraction(1_000_000)
        cycles = engine.strobe_read(out, period, engine.now_ps + len(out) * int(period))
        best = max(best, cycles / (time.perf_counter() - start))
    return best


def stored_frame(*, skipping: bool) -> tuple[float, RtlEngine]:
    """Store a frame; returns pixel clocks per second of wall time, and the engine."""
    top = CubeStarTop()
    engine = make_engine(cubestar_wiring(top), "compiled", skipping=skipping)
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (top.rows, top.columns), dtype=np.uint8)
    engine.attach(RepeatedFrame(image, PERIOD, LINE_CLOCKS))
    engine.set_pin(ENABLE, 1)
    frame_ps = int(top.rows * LINE_CLOCKS * PERIOD)
    start = time.perf_counter()
    reached = engine.run(2 * frame_ps, (ACK, 1))
    wall_s = time.perf_counter() - start
    return float(reached / PERIOD) / wall_s, engine
