"""The SRAM's rules at the slowest delays of a placed design, with a camera that is early or late.

For a board of its own: camera, SRAM and microcontroller at the FPGA's pads.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import Sram, SramPins
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_nextpnr, have_yosys
from tests.hdl.harness.delays import Delay, pad_delays, sdf_of

PERIOD_PS, ROWS, COLUMNS = 100_000, 2, 1024

needs_tools = pytest.mark.skipif(
    not (have_yosys() and have_nextpnr()), reason="needs the extras hdl and place"
)


def image() -> NDArray[np.uint8]:
    return np.random.default_rng(1).integers(0, 256, (ROWS, COLUMNS), np.uint8)


def store_events(skew_ps: int) -> Iterator[PinEvent]:
    """The first rows of a frame; data and line change ``skew_ps`` after the clock falls."""
    yield PinEvent(0, "VSYNC", 1)
    yield PinEvent(0, "ENABLE", 1)
    blank = [(0, 0)] * 8
    samples = blank + [s for row in image() for s in [*((1, int(p)) for p in row), *blank]]
    for number, (line, pixel) in enumerate(samples, 1):
        fall = number * PERIOD_PS + PERIOD_PS // 2
        changes = [
            PinEvent(number * PERIOD_PS, "PIXCLK", 1),
            PinEvent(fall + skew_ps, "PIXDATA", pixel),
            PinEvent(fall + skew_ps, "HSYNC", line),
            PinEvent(fall, "PIXCLK", 0),
        ]
        yield from sorted(changes, key=lambda event: event.time_ps)


def delayed(skew_ps: int, delays: dict[str, Delay], late_ps: int = 0) -> Sram:
    """The memory after the rows, with each output bit as late as its longest path.

    ``late_ps``: further delay of WE_N.
    """
    wiring = cubestar_wiring(CubeStarTop())
    engine = make_engine(wiring)
    events, names = list(store_events(skew_ps)), wiring.output_pins
    rows = engine.apply(events)
    changes = []
    before = np.zeros(len(names), np.int64)
    for event, row in zip(events, rows, strict=True):
        for place in np.flatnonzero(row != before):
            name = names[place]
            for bit in range(wiring.widths[name]):
                level = int(row[place]) >> bit & 1
                if level == int(before[place]) >> bit & 1:
                    continue
                delay = 0
                if event.pin == "PIXCLK":
                    pad = delays[f"{name}[{bit}]" if wiring.widths[name] > 1 else name]
                    # The clock itself ends and begins the write pulse; all else is clocked.
                    path = pad.logic_ps if name == "SRAM_WE_N" else pad.clocked_ps
                    assert path is not None
                    delay = path + late_ps * (name == "SRAM_WE_N")
                changes.append((event.time_ps + delay, name, bit, level))
        before = row
    engine.close()
    return _written(sorted(changes, key=lambda change: change[0]))


def _written(changes: list[tuple[int, str, int, int]]) -> Sram:
    levels = dict.fromkeys(("SRAM_A", "SRAM_D_O", "SRAM_D_OE"), 0)
    levels |= dict.fromkeys(("SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"), 1)
    sram = Sram(np.zeros(1 << 20, np.uint8))
    for time_ps, name, bit, level in changes:
        if name in levels:
            levels[name] = levels[name] & ~(1 << bit) | level << bit
            a, data, drives, *strobes = levels.values()
            sram.drive(time_ps, SramPins(a, *strobes, data if drives else None))
    return sram


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize("skew_ps", [-10_000, 0, 10_000])
def test_slowest_part_and_skewed_camera_break_no_rule_of_the_sram(skew_ps: int) -> None:
    sram = delayed(skew_ps, pad_delays(sdf_of(CubeStarTop), "PIXCLK"))
    assert not sram.violations.counts
    assert np.array_equal(sram.memory[: ROWS * COLUMNS].reshape(ROWS, COLUMNS), image())


@needs_tools
@pytest.mark.slow
def test_write_pulse_that_ends_late_is_found() -> None:
    sram = delayed(0, pad_delays(sdf_of(CubeStarTop), "PIXCLK"), late_ps=12_000)
    assert sram.violations.counts["address-changed-during-write"]
