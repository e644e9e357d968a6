"""The compiled engine's bursts on copies of a design, and Amaranth's simulator, edge by edge."""

from fractions import Fraction
from itertools import islice

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.benchmark import RepeatedFrame
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.clock_steps import clock_steps
from cubestack.emulator.rtl.cxxrtl.variants import members, variant_text
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.flow.generate import rtlil_text
from tests.benchmarks.engines.workloads import WORKLOADS
from tests.tiers import quick_ones

from .board_events import BOARDS

SETTLED_PS = 1_000
STEPS = 400


def levels(engine: RtlEngine) -> dict[str, object]:
    wiring = engine.wiring
    pins = {name: engine.get_pin(name) for name in (*wiring.output_pins, *wiring.mcu_pins)}
    for memory in wiring.memories:
        if not pins[memory["D_OE"]]:
            del pins[memory["D_O"]]
    memories = {name: memory.tobytes() for name, memory in engine.memories.items()}
    return {**pins, **memories, "now": engine.now_ps, "broken": engine.violations}


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize("name", quick_ones(BOARDS, "cubestar"))
def test_skipped_bursts_settle_like_single_edges(name: str) -> None:
    board = BOARDS[name]
    wiring = board.wiring(False)
    rng = np.random.default_rng([*name.encode()])
    reference = make_engine(wiring, "python", skipping=False)
    engines = [make_engine(wiring, "compiled", skipping=skipping) for skipping in (True, False)]
    for camera in wiring.cameras:
        source = RepeatedFrame(
            rng.integers(0, 256, (board.rows, board.columns), dtype=np.uint8),
            Fraction(10**12, int(rng.integers(9_000_000, 24_000_000))),
            board.columns + 4,
            board.gap + 3,
        )
        for engine in (reference, *engines):
            engine.attach(source, camera.name)
    acknowledged = 0
    for number, (wait_ps, pin, level) in enumerate(islice(board.script(rng), STEPS)):
        now_ps = reference.now_ps + max(wait_ps, SETTLED_PS)
        for engine in (reference, *engines):
            if number % 2:
                engine.run(now_ps, (str(wiring.acknowledges[-1]), 1))
            engine.run(now_ps)
            engine.set_pin(pin, level)
        expected = levels(reference)
        acknowledged += sum(reference.get_pin(ack) for ack in wiring.acknowledges)
        for engine in engines:
            assert levels(engine) == expected, number
    assert acknowledged
    for engine in engines:
        engine.close()


def suits(wiring: Wiring, at: dict[str, int], burst: tuple[tuple[str, int], ...]) -> bool:
    return all((wiring.initial | at)[pin] == level for pin, level in burst)


@pytest.mark.slow
@pytest.mark.parametrize("name", WORKLOADS)
def test_benchmark_workloads_run_in_single_clock_steps(name: str) -> None:
    """The levels have a copy of their own, of which each camera's share of an edge is known."""
    wiring, load = BOARDS[name].wiring(False), WORKLOADS[name]
    rtlil = rtlil_text(wiring.component)
    at = dict(load.levels)
    (number,) = [n for n, burst in enumerate(wiring.burst_levels) if suits(wiring, at, burst)]
    variant = variant_text(rtlil, wiring.burst_levels[number])
    text = clock_steps(wiring, variant, dict(members(variant)), number)
    assert text.count("bool in_reset(") == len(wiring.cameras)
    assert "return true; }" not in text
    assert text.count("changed |= ") > 10 * len(load.stored)
