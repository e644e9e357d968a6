"""A processor on the external bus of a small FPGA: time, interruptions, and interrupts' own reads.

The clock is 48 MHz; the FPGA is option 3's, so that a memory can be reached beside a store.
"""

from collections.abc import Callable, Generator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_double_wiring
from cubestack.emulator.rtl.cxxrtl.build import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.requests import AwaitPin, BusAccess, Pay, SetPin
from cubestack.hdl.cubestar.double_top import CubeStarDouble

from ..conftest import Desk

COLUMNS, ROWS = 8, 4
PIXELS = COLUMNS * ROWS
CYCLES = 8
Body = Generator[Any, Any, None]

SECOND = np.arange(PIXELS, 2 * PIXELS, dtype=np.int32)
"""Places in the second memory."""


def desk_with(body: Callable[[Desk], Body], tick_ns: int | None = None) -> Desk:
    """Runs one body; ``tick_ns`` puts events of others on the way."""
    kind = "python" if find_compiler() is None else "compiled"
    engine = make_engine(cubestar_double_wiring(CubeStarDouble(COLUMNS, ROWS)), kind)
    engine.memories["SRAM2"][:] = np.arange(PIXELS) + 100

    def enabled(desk: Desk) -> Body:
        yield SetPin("RNW", 1)
        yield SetPin("ENABLE", 1)
        yield from body(desk)

    desk = Desk(enabled, table=CORTEX_M3, engine=engine)

    def tick() -> Body:
        while tick_ns is not None:
            yield desk.kernel.timeout(1000 * tick_ns)

    desk.kernel.process(tick())
    return desk


def read(count: int = PIXELS, above: int = 255) -> tuple[BusAccess, np.ndarray]:
    data = np.zeros(count, np.uint8)
    return BusAccess(SECOND[:count].copy(), data, False, CYCLES, above=above), data


@pytest.mark.parametrize("tick_ns", [None, 7, 130, 1001])
def test_accesses_take_their_cycles_whoever_interrupts(tick_ns: int | None) -> None:
    times: list[int] = []
    request, data = read()

    def body(desk: Desk) -> Body:
        yield Pay()
        times.append(desk.kernel.now)
        assert (yield request) == PIXELS
        times.append(desk.kernel.now)

    desk = desk_with(body, tick_ns).run(1000)
    assert np.array_equal(data, np.arange(PIXELS) + 100)
    took_ps = times[1] - times[0]
    # What is rounded off at an interruption is less than a picosecond each.
    assert took_ps == pytest.approx(PIXELS * CYCLES * 1e12 / 48e6, abs=PIXELS)
    assert not desk.engine.violation_counts


def test_a_search_stops_where_the_byte_is() -> None:
    request, data = read(above=109)
    made: list[int] = []

    def body(_desk: Desk) -> Body:
        made.append((yield request))

    desk_with(body, 130).run(1000)
    assert made == [11]
    assert data[10] == 110
    assert not data[11:].any()


def test_writes_are_in_memory() -> None:
    values = np.arange(PIXELS, dtype=np.uint8)[::-1].copy()

    def body(_desk: Desk) -> Body:
        yield BusAccess(SECOND.copy(), values, True, CYCLES)

    assert np.array_equal(desk_with(body, 333).run(1000).engine.memories["SRAM2"], values)


def test_an_interrupt_reads_in_between_and_pays_for_it() -> None:
    request, data = read()
    loaded: list[bytes] = []
    ended: list[int] = []

    def body(desk: Desk) -> Body:
        yield request
        ended.append(desk.kernel.now)
        yield SetPin("RNW", 0)  # would be in the FPGA's past, were the reads not paid

    def interrupt(desk: Desk) -> None:
        loaded.append(desk.processor.load(0, PIXELS + 4, 6, CYCLES))
        desk.meter.charge(ebi_read=6)

    plain = desk_with(body).run(1000)
    disturbed = desk_with(body)
    for ns in (1100, 3000, 3001):
        disturbed.at(ns / 1000, lambda: interrupt(disturbed))
    disturbed.run(1000)
    assert loaded == [bytes(range(104, 110))] * 3
    assert np.array_equal(data, np.arange(PIXELS) + 100)
    cost_ps = 3 * 6 * CYCLES * 10**12 / 48e6
    assert ended[1] - ended[0] == pytest.approx(cost_ps, abs=PIXELS)
    assert plain.engine.get_pin("RNW") == disturbed.engine.get_pin("RNW") == 0


def test_an_interrupt_reads_while_the_program_waits_for_the_fpga() -> None:
    """The FPGA is ahead of the kernel then, and neither runs back."""
    waited: list[bool] = []
    loaded: list[bytes] = []

    def body(_desk: Desk) -> Body:
        yield SetPin("INTO", 0)
        yield SetPin("RNW", 0)
        waited.append((yield AwaitPin("ACK", 1, 100, 8)))

    desk = desk_with(body, 50)

    def interrupt() -> None:
        loaded.append(desk.processor.load(0, 2 * PIXELS - 3, 3, CYCLES))
        desk.meter.charge(ebi_read=3)

    for ns in range(2000, 90_000, 977):
        desk.at(ns / 1000, interrupt)
    desk.run(1000)
    assert waited == [False]  # no camera
    assert set(loaded) == {bytes([129, 130, 131])}


def test_use_of_the_bus_is_told_once() -> None:
    def body(_desk: Desk) -> Body:
        for _ in range(3):
            yield read(4)[0]
        yield Pay()
        yield read(4)[0]

    assert desk_with(body).run(1000).accessing == [True, False, True, False]
