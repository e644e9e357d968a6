"""Measures the compiled engine with CubeSense's two FPGAs."""

import time
from fractions import Fraction

import numpy as np

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.rtl.benchmark import ROUNDS, RepeatedFrame
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras import ov7620
from cubestack.firmware_model.interface.cameras.ov7620 import CLOCKS_PER_LINE, LINES_PER_FRAME
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.pins import ACKNOWLEDGE, CONTROLS

_SUN, _NADIR = ACKNOWLEDGE.values()

#: Commands to store: levels of SHIFT, EDGE, RNW, SUNEN and NADEN, and the acknowledges.
STORES = {
    "own": ((0, 0, 0, 0, 1), (_SUN,)),
    "linked": ((1, 0, 0, 0, 0), (_NADIR,)),
    "both": ((0, 0, 0, 0, 0), (_SUN, _NADIR)),
}
_SCAN_PERIOD = Fraction(PS_PER_S, 1_000_000)
_PERIOD = Fraction(PS_PER_S, ov7620.PIXEL_CLOCK_HZ)


def pair_store_ms(engine: RtlEngine, way: str, rounds: int = ROUNDS) -> float:
    """Shortest wall time in ms to store a frame by command ``way`` of ``STORES``."""
    levels, acknowledges = STORES[way]
    best = float("inf")
    for _ in range(rounds):
        # Start from standby, in the gap between two frames.
        _command(engine, 0, 0, 0, 1, 1)
        frame_ps = CLOCKS_PER_LINE * LINES_PER_FRAME * _PERIOD
        engine.run(int((engine.now_ps // frame_ps + 1) * frame_ps))
        _command(engine, *levels)
        start = time.perf_counter()
        for pin in acknowledges:
            engine.run(engine.now_ps + int(frame_ps), (pin, 1))
        best = min(best, time.perf_counter() - start)
    return 1000 * best


def pair_scan_ms(engine: RtlEngine, rounds: int = ROUNDS) -> float:
    """Wall time in ms of a nadir scan from the nadir camera's memory."""
    out = np.empty(FULL_SIZE.scan_clocks, np.uint8)
    best = float("inf")
    for _ in range(rounds):
        _command(engine, 0, 0, 0, 1, 1)
        _command(engine, 0, 1, 1, 1, 0)
        engine.run(engine.now_ps + 1_000_000)
        end_ps = engine.now_ps + len(out) * int(_SCAN_PERIOD)
        start = time.perf_counter()
        engine.strobe_read(out, _SCAN_PERIOD, end_ps)
        best = min(best, time.perf_counter() - start)
    return 1000 * best


def pair_with_cameras() -> RtlEngine:
    """An engine with both FPGAs, and cameras that repeat one frame."""
    engine = make_engine(cubesense_wiring(), "compiled")
    rng = np.random.default_rng(0)
    blank = CLOCKS_PER_LINE * (LINES_PER_FRAME - FULL_SIZE.rows)
    for camera in ("sun", "nadir"):
        image = rng.integers(0, 256, (FULL_SIZE.rows, FULL_SIZE.columns), dtype=np.uint8)
        engine.attach(RepeatedFrame(image, _PERIOD, CLOCKS_PER_LINE, blank), camera)
    return engine


def _command(engine: RtlEngine, *levels: int) -> None:
    for pin, level in zip(CONTROLS, levels, strict=True):
        engine.set_pin(pin, level)
