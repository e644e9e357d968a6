"""Foreign designs of CubeStar store and read what the shipped one does."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from amaranth.hdl import ClockDomain, ClockSignal, Module, Signal

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.benchmark import RepeatedFrame
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_yosys
from tests.hdl.user.designs import WORKING, load_design
from tests.tiers import quick_ones

from .devboard.boards import direct

pytestmark = [pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")]

COLUMNS, ROWS = 18, 5
PERIOD = Fraction(100_000)
GAP = 30


def store_and_read(engine: RtlEngine, joined_at: float) -> tuple[bytes, bytes, bool, list[object]]:
    """Memory and read-out after two frames stored into either bank, joined half-way."""
    frame_clocks = ROWS * (COLUMNS + GAP) + 3 * GAP
    frame_ps = int(frame_clocks * PERIOD)
    rng = np.random.default_rng(7)
    out = np.zeros(COLUMNS * ROWS + 30, np.uint8)
    acknowledged = True
    for bank in (0, 1):
        image = rng.integers(0, 256, (ROWS, COLUMNS), dtype=np.uint8)
        engine.attach(RepeatedFrame(image, PERIOD, COLUMNS + GAP, 3 * GAP))
        engine.run(engine.now_ps + int(joined_at * frame_ps))
        for pin, level in (("BANK", bank), ("RNW", 0), ("ENABLE", 1)):
            engine.set_pin(pin, level)
        engine.run(engine.now_ps + 4 * frame_ps, ("ACK", 1))
        acknowledged &= engine.get_pin("ACK") == 1
        engine.run(engine.now_ps + frame_ps // 3)
        engine.set_pin("ENABLE", 0)
        engine.run(engine.now_ps + 1_000_000)
    acknowledged &= engine.get_pin("ACK") == 0
    engine.attach(None)
    for pin, level in (("RNW", 1), ("ENABLE", 1)):
        engine.set_pin(pin, level)
    engine.run(engine.now_ps + 1_000_000)
    engine.strobe_read(out, Fraction(800_000), engine.now_ps + len(out) * 800_000 + 10)
    kinds: list[object] = sorted({str(violation.kind) for violation in engine.violations})
    engine.close()
    return engine.sram.tobytes(), out.tobytes(), acknowledged, kinds


@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
@pytest.mark.parametrize("skipping", [True, False])
@pytest.mark.parametrize("name", quick_ones(WORKING, "latch"))
def test_foreign_design_stores_and_reads_like_the_shipped_one(name: str, skipping: bool) -> None:
    shipped = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    foreign = shipped.with_design(load_design(WORKING[name], COLUMNS, ROWS))
    for joined_at in (0.0, 0.4):
        expected = store_and_read(CompiledEngine(shipped), joined_at)
        found = store_and_read(CompiledEngine(foreign, skipping=skipping), joined_at)
        assert found == expected
    assert expected[2:] == (True, [])


class PauseCounter(PinnedComponent):
    """ACK rises after a number of pixel clocks between two lines."""

    def __init__(self) -> None:
        super().__init__(CubeStarTop(COLUMNS, ROWS).pins)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.pix = ClockDomain(reset_less=True)
        count = Signal(8)
        m.d.comb += [
            ClockSignal("pix").eq(self.PIXCLK),
            self.ACK.eq(count == GAP - 5),
            *(strobe.eq(1) for strobe in (self.SRAM_CE_N, self.SRAM_OE_N, self.SRAM_WE_N)),
        ]
        with m.If(self.HSYNC):
            m.d.pix += count.eq(0)
        with m.Elif(count != GAP - 5):
            m.d.pix += count.eq(count + 1)
        return m


def acknowledged_ps(engine: RtlEngine) -> int:
    engine.attach(RepeatedFrame(np.zeros((ROWS, COLUMNS), np.uint8), PERIOD, COLUMNS + GAP, GAP))
    engine.run(int((COLUMNS + GAP) * PERIOD))  # into the first lines
    engine.set_pin("ENABLE", 1)
    engine.run(int(10 * ROWS * (COLUMNS + GAP) * PERIOD), ("ACK", 1))
    engine.close()
    return engine.now_ps


@pytest.mark.parametrize("engine", [SimulatedEngine, direct])
def test_engines_run_each_clock_between_lines_of_a_user_s_design(
    engine: Callable[[Wiring], RtlEngine],
) -> None:
    foreign = cubestar_wiring(CubeStarTop(COLUMNS, ROWS)).with_design(PauseCounter())
    expected = acknowledged_ps(CompiledEngine(foreign, skipping=False))
    assert expected < int(2 * (COLUMNS + GAP) * PERIOD) + GAP * PERIOD
    assert acknowledged_ps(engine(foreign)) == expected
