"""A scope at the pins of a design that stores and is read, against its memory and its own rules."""

from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.recording.scope import Scope
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import make_engine

PINS = ("DCLK", "DATA", "SRAM_A", "SRAM_OE_N")
STEP_PS, PERIOD_PS, BYTES = 10_000, 770_000, 40


def reading() -> RtlEngine:
    """An engine whose memory holds the numbers from 1 on, in read mode."""
    engine = make_engine(cubestar_wiring())
    engine.sram[:BYTES] = np.arange(1, BYTES + 1)
    engine.run(1_000_000)
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    engine.run(2_000_000)
    return engine


def strobed(engine: RtlEngine) -> list[int]:
    out = np.zeros(BYTES, np.uint8)
    assert engine.strobe_read(out, Fraction(PERIOD_PS), 10**9) == BYTES
    return [int(byte) for byte in out]


@pytest.mark.parametrize("clocks", [3, BYTES, 2 * BYTES])
def test_every_data_clock_of_the_window_is_seen_and_the_bytes_stay(clocks: int) -> None:
    engine = reading()
    start = engine.now_ps
    scope = Scope(engine, PINS, start, start + clocks * PERIOD_PS, STEP_PS)
    assert strobed(engine) == [*range(1, BYTES + 1)]
    engine.run(start + 2 * BYTES * PERIOD_PS)
    scope.close()
    rises = [time for time, level in scope.changes["DCLK"] if level]
    seen = min(clocks, BYTES)
    assert len(rises) in (seen, seen + 1)  # the next one may be at the window's end
    for byte, time_ps in enumerate(rises[:seen]):
        assert 0 <= time_ps - start - byte * PERIOD_PS <= STEP_PS
    assert [level for _, level in scope.changes["DATA"]][1 : seen + 1] == [*range(1, seen + 1)]
    assert engine.now_ps == start + 2 * BYTES * PERIOD_PS


def test_a_closed_scope_leaves_no_mark() -> None:
    engine, other = reading(), reading()
    now = engine.now_ps
    Scope(engine, PINS, now, now + PERIOD_PS, STEP_PS).close()
    assert strobed(engine) == strobed(other)
    assert engine.now_ps == other.now_ps


def test_a_window_that_is_over_is_refused() -> None:
    engine = reading()
    for start, end, step in ((0, 10**9, 1), (10**9, 10**9, 1), (10**9, 10**10, 0)):
        with pytest.raises(ValueError, match="empty or past scope window"):
            Scope(engine, PINS, start, end, step)
