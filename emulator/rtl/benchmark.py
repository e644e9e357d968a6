"""How fast the compiled engine is, and how long its first builds take."""

import tempfile
import time
from fractions import Fraction
from pathlib import Path

import numpy as np

from cubestack.emulator.rtl.contract import RtlEngine, make_engine
from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.repeated_frame import RepeatedFrame
from cubestack.emulator.rtl.wiring import Wiring, cubesense_wiring, cubestar_wiring
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS
from cubestack.firmware_model.interface.cameras.ov7620 import (
    CLOCKS_PER_LINE,
    LINES_PER_FRAME,
    PIXEL_CLOCK_HZ,
)
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.hdl.cubestar.top import CubeStarTop

__all__ = [
    "PAIR_STORES",
    "cold_build_s",
    "pair_scan_ms",
    "pair_store_ms",
    "rtl_clocks_per_s",
    "strobes_per_s",
]

PERIOD = Fraction(PS_PER_S, CRYSTAL_HZ)
ROUNDS = 5  # the best one counts: the others were disturbed

#: CubeSense's ways to store: levels of SHIFT, EDGE, RNW, SUNEN and NADEN, and the acknowledges.
PAIR_STORES = {
    "own": ((0, 0, 0, 0, 1), ("SUNACK",)),
    "linked": ((1, 0, 0, 0, 0), ("NADACK",)),
    "both": ((0, 0, 0, 0, 0), ("SUNACK", "NADACK")),
}
_CONTROLS = ("SHIFT", "EDGE", "RNW", "SUNEN", "NADEN")
_SCAN_PERIOD = Fraction(PS_PER_S, 1_000_000)


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


def pair_store_ms(way: str) -> float:
    """Wall time in which CubeSense's FPGAs store a frame in one of ``PAIR_STORES``."""
    engine = _pair()
    levels, acknowledges = PAIR_STORES[way]
    best = float("inf")
    for _ in range(ROUNDS):
        # From standby in the middle of the gap between two frames.
        _command(engine, 0, 0, 0, 1, 1)
        frame_ps = CLOCKS_PER_LINE * LINES_PER_FRAME * Fraction(PS_PER_S, PIXEL_CLOCK_HZ)
        engine.run(int((engine.now_ps // frame_ps + 1) * frame_ps))
        _command(engine, *levels)
        start = time.perf_counter()
        for pin in acknowledges:
            engine.run(engine.now_ps + int(frame_ps), (pin, 1))
        best = min(best, time.perf_counter() - start)
    return 1000 * best


def pair_scan_ms() -> float:
    """Wall time of a nadir scan from the nadir's memory."""
    engine = _pair()
    out = np.empty(FULL_SIZE.scan_clocks, np.uint8)
    best = float("inf")
    for _ in range(ROUNDS):
        _command(engine, 0, 0, 0, 1, 1)
        _command(engine, 0, 1, 1, 1, 0)
        engine.run(engine.now_ps + 1_000_000)
        start = time.perf_counter()
        reach_ps = len(out) * int(_SCAN_PERIOD)
        engine.strobe_read(out, _SCAN_PERIOD, engine.now_ps + reach_ps)
        best = min(best, time.perf_counter() - start)
    return 1000 * best


def cold_build_s(wiring: Wiring | None = None) -> float:
    """Wall time from a design to its shared library, with nothing in the cache.

    CubeStar's board, unless given.
    """
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        library_for(wiring or cubestar_wiring(), Path(folder))
        return time.perf_counter() - start


def _store(*, skipping: bool) -> tuple[float, RtlEngine]:
    top = CubeStarTop()
    engine = make_engine(top, "compiled", skipping=skipping)
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (top.rows, top.columns), dtype=np.uint8)
    engine.attach(RepeatedFrame(image, PERIOD, LINE_CLOCKS))
    engine.set_pin("ENABLE", 1)
    frame_ps = int(top.rows * LINE_CLOCKS * PERIOD)
    start = time.perf_counter()
    reached = engine.run(2 * frame_ps, ("ACK", 1))
    wall_s = time.perf_counter() - start
    return float(reached / PERIOD) / wall_s, engine


def _pair() -> RtlEngine:
    engine = make_engine(cubesense_wiring(), "compiled")
    rng = np.random.default_rng(0)
    blank = CLOCKS_PER_LINE * (LINES_PER_FRAME - FULL_SIZE.rows)
    for camera in ("sun", "nadir"):
        image = rng.integers(0, 256, (FULL_SIZE.rows, FULL_SIZE.columns), dtype=np.uint8)
        period = Fraction(PS_PER_S, PIXEL_CLOCK_HZ)
        engine.attach(RepeatedFrame(image, period, CLOCKS_PER_LINE, blank), camera)
    return engine


def _command(engine: RtlEngine, *levels: int) -> None:
    for pin, level in zip(_CONTROLS, levels, strict=True):
        engine.set_pin(pin, level)
