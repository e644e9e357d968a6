"""A processor on the external bus of a small FPGA: time, interruptions, and interrupts' own reads.

The clock is 48 MHz; the FPGA is option 3's, so that a memory can be reached beside a store.
"""

from collections.abc import Generator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_double_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.sim.firmware_fpga import FpgaCoupling
from cubestack.emulator.sim.fpga_port import STEPS, TAKE, Transactions
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.external_bus import EBI, BusTiming
from cubestack.firmware_model.mcu.requests import AwaitPin, BusAccess, Pay, SetPin
from cubestack.hdl.cubestar.double_top import CubeStarDouble

from ..conftest import Desk, script

COLUMNS, ROWS = 8, 4
PIXELS = COLUMNS * ROWS
CYCLES = 8

SECOND = np.arange(PIXELS, 2 * PIXELS, dtype=np.int32)  #: Places in the second memory


def desk_with(*steps: object, tick_ns: int | None = None) -> Desk:
    """Runs one script; ``tick_ns`` puts events of others on the way."""
    kind = "python" if find_compiler() is None else "compiled"
    engine = make_engine(cubestar_double_wiring(CubeStarDouble(COLUMNS, ROWS)), kind)
    engine.memories["SRAM2"][:] = np.arange(PIXELS) + 100
    body = script(SetPin("RNW", 1), SetPin("ENABLE", 1), *steps)
    desk = Desk(body, table=CORTEX_M3, engine=engine)

    def tick() -> Generator[Any, Any, None]:
        while tick_ns is not None:
            yield desk.kernel.timeout(1000 * tick_ns)

    desk.kernel.process(tick())
    return desk


def read(count: int = PIXELS, above: int = 255) -> tuple[BusAccess, np.ndarray]:
    data = np.zeros(count, np.uint8)
    return BusAccess(SECOND[:count].copy(), data, False, CYCLES, 0, above), data


@pytest.mark.parametrize("tick_ns", [None, 7, 130, 1001])
def test_bus_accesses_take_their_cycles_despite_timer_interrupts(tick_ns: int | None) -> None:
    times: list[int] = []
    request, data = read()

    def note_ps(desk: Desk) -> None:
        times.append(desk.kernel.now)

    desk = desk_with(Pay(), note_ps, request, note_ps, tick_ns=tick_ns).run(1000)
    assert desk.log[-1][1] == PIXELS
    assert np.array_equal(data, np.arange(PIXELS) + 100)
    # What is rounded off at an interruption is less than a picosecond each.
    assert times[1] - times[0] == pytest.approx(PIXELS * CYCLES * 1e12 / 48e6, abs=PIXELS)
    assert not desk.engine.violation_counts


def test_bus_search_stops_at_the_first_byte_above_the_limit() -> None:
    request, data = read(above=109)
    assert desk_with(request, tick_ns=130).run(1000).log[-1][1] == 11
    assert data[10] == 110
    assert not data[11:].any()


def test_bus_writes_reach_the_memory() -> None:
    values = np.arange(PIXELS, dtype=np.uint8)[::-1].copy()
    desk = desk_with(BusAccess(SECOND.copy(), values, True, CYCLES, 0, 255), tick_ns=333).run(1000)
    assert np.array_equal(desk.engine.memories["SRAM2"], values)


def load(desk: Desk, address: int, count: int) -> bytes:
    desk.meter.charge(ebi_read=count)
    return desk.processor.load(0, address, count, CYCLES)


def test_interrupt_reads_between_bus_accesses_and_is_charged() -> None:
    loaded: list[bytes] = []
    ended: list[int] = []
    request, data = read()
    # The pin would be driven in the FPGA's past, were the reads not paid.
    steps = (request, lambda desk: ended.append(desk.kernel.now), SetPin("RNW", 0))
    plain, disturbed = desk_with(*steps).run(1000), desk_with(*steps)
    for ns in (1100, 3000, 3001):
        disturbed.at(ns / 1000, lambda: loaded.append(load(disturbed, PIXELS + 4, 6)))
    disturbed.run(1000)
    assert loaded == [bytes(range(104, 110))] * 3
    assert np.array_equal(data, np.arange(PIXELS) + 100)
    cost_ps = 3 * 6 * CYCLES * 10**12 / 48e6
    assert ended[1] - ended[0] == pytest.approx(cost_ps, abs=PIXELS)
    assert plain.engine.get_pin("RNW") == disturbed.engine.get_pin("RNW") == 0


def test_interrupt_can_read_while_the_program_waits_for_the_fpga() -> None:
    """The FPGA is ahead of the kernel then, and neither runs back."""
    loaded: set[bytes] = set()
    desk = desk_with(SetPin("INTO", 0), SetPin("RNW", 0), AwaitPin("ACK", 1, 100, 8), tick_ns=50)
    for ns in range(2000, 90_000, 977):
        desk.at(ns / 1000, lambda: loaded.add(load(desk, 2 * PIXELS - 3, 3)))
    assert desk.run(1000).log[-1][1] is False  # no camera
    assert loaded == {bytes([129, 130, 131])}


def test_reports_bus_use_once() -> None:
    request, _ = read(4)
    desk = desk_with(request, request, request, Pay(), request).run(1000)
    assert desk.accessing == [True, False, True, False]


CYCLE = Fraction(10**12, 48_000_000)


def made(count: int = 3, **changes: Any) -> Transactions:
    given: dict[str, Any] = {
        "addresses": np.arange(count, dtype=np.int32),
        "data": np.zeros(count, np.uint8),
        "write": False,
        "cycle": CYCLE,
        "cycles": EBI.cycles + 2,
    }
    return Transactions(**given | changes)


def test_bus_event_times_are_sums_of_the_phase_durations() -> None:
    timing = BusTiming(2, 3, 1, 7, 2)
    one = made(timing=timing, cycles=40)
    # Latch opens, closes; select; strobe falls, rises; release.
    assert one.offsets == (0, 2, 5, 6, 13, 15)
    assert len(one.offsets) == STEPS
    assert one.offsets[TAKE] - one.offsets[TAKE - 1] == timing.strobe
    assert one.offsets[-1] == timing.cycles
    for event in range(3 * STEPS):
        index, step = event // STEPS, event % STEPS
        exact = (40 * index + one.offsets[step]) * CYCLE
        assert 0 <= exact - one.time_of(event) < 1
    assert one.period == 40 * CYCLE


def test_first_transactions_share_the_memory_of_the_whole() -> None:
    whole = made(5)
    some = whole.first(2)
    assert (len(whole), len(some)) == (5, 2)
    assert some.addresses.tolist() == [0, 1]
    assert np.shares_memory(some.data, whole.data)
    assert (some.cycle, some.cycles, some.write) == (whole.cycle, whole.cycles, whole.write)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"addresses": np.arange(3)}, "transactions need contiguous int32"),
        ({"addresses": np.arange(6, dtype=np.int32)[::2]}, "transactions need contiguous int32"),
        ({"addresses": np.zeros((3, 1), np.int32)}, "transactions need contiguous int32"),
        ({"data": np.zeros(3, np.int8)}, "transactions need contiguous uint8"),
        ({"data": np.zeros(2, np.uint8)}, "3 addresses have 2 bytes: one each is needed"),
        ({"cycles": EBI.cycles - 1}, f"takes {EBI.cycles} cycles, not {EBI.cycles - 1}"),
    ],
)
def test_transactions_reject_inconsistent_arguments(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        made(**changes)
    assert made(cycles=EBI.cycles).cycles == EBI.cycles


NOBODY = -1


class Memory:
    """An FPGA that is all memory: a byte at each address of each chip select."""

    driver = None
    running = 0

    def __init__(self) -> None:
        self.now_ps = 0
        self.bytes: dict[tuple[int, int], int] = {}

    def attend(self, *_burst: int) -> int:
        return 0

    def run(self, until_ps: int) -> int:
        self.now_ps = until_ps
        return until_ps

    def access(self, wanted: Transactions, until_ps: int) -> None:
        place = wanted.select, int(wanted.addresses[0])
        if wanted.write:
            self.bytes[place] = int(wanted.data[0])
        else:
            wanted.data[0] = self.bytes[place]


class Pins:
    hz = 48_000_000

    def couple(self, record: Any, _wires: Any) -> None:
        self.access = record.slow_external

    def stop(self) -> None: ...


def test_banks_select_the_wired_chip_selects() -> None:
    fpga, machine = Memory(), Pins()
    coupling = FpgaCoupling(machine, fpga, (), banks=(2, 0))  # type: ignore[arg-type]
    machine.access(2, 0x100, 17, 1000)
    machine.access(0, 0x100, 34, 2000)
    assert fpga.bytes == {(0, 0x100): 17, (1, 0x100): 34}
    assert [machine.access(bank, 0x100, -1, 3000) for bank in (2, 0)] == [17, 34]
    assert [machine.access(bank, 0x100, -1, 4000) for bank in (1, 3)] == [NOBODY, NOBODY]
    coupling.after_run(5000)  # nothing was raised meanwhile
