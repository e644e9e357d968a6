from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from unittest.mock import patch

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import (
    cubestar_double_wiring,
    cubestar_shared_wiring,
    cubestar_two_boards_wiring,
    cubestar_wiring,
)
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.fpga_port import Transactions
from cubestack.firmware_model.mcu.external_bus import BusTiming
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop

from .cameras import Step, assert_same, engines, plain_camera, random_camera

COLUMNS, ROWS = 8, 4
CYCLE = Fraction(10**12, 48_000_000)
WIRINGS = {
    CubeStarShared: cubestar_shared_wiring,
    CubeStarDouble: cubestar_double_wiring,
    CubeStarTwoBoards: cubestar_two_boards_wiring,
}

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="there is no C++ compiler")


def transactions(addresses, data=None, **options) -> Transactions:
    addresses = np.ascontiguousarray(addresses, np.int32)
    write = data is not None
    data = np.array(data, np.uint8) if write else np.zeros(len(addresses), np.uint8)
    return Transactions(addresses, data, write, CYCLE, options.pop("cycles", 8), **options)


def controls(wiring: Wiring) -> list[str]:
    mine = {*wiring.bus.selects, "AD_HIGH", "AD_LOW_I", "ALE", "RE_N", "WE_N"}
    return [pin for pin in wiring.mcu_pins if pin not in mine]


def random_access(rng: np.random.Generator, wiring: Wiring) -> tuple[Transactions, int]:
    count = int(rng.integers(0, 12))
    addresses = rng.integers(0, 1 << 24 if rng.random() < 0.1 else 4 * COLUMNS * ROWS, count)
    timing = BusTiming(*(int(cycles) for cycles in rng.integers(1, 4, 5)))
    made = transactions(
        addresses,
        rng.integers(0, 256, count) if rng.random() < 0.5 else None,
        cycles=timing.cycles + int(rng.integers(0, 4)),
        select=int(rng.integers(len(wiring.bus.selects))),
        above=int(rng.choice([255, 255, 128])),
        timing=timing,
    )
    return made, int(made.period * int(rng.integers(0, 14)))


def accessed(engine: RtlEngine, made: Transactions, reach_ps: int) -> tuple[int, bytes]:
    mine = replace(made, data=made.data.copy())
    return engine.access(mine, engine.now_ps + reach_ps), mine.data.tobytes()


def random_step(rng: np.random.Generator, wiring: Wiring) -> Step:
    kind = rng.random()
    if kind < 0.3:
        pin, level = str(rng.choice(controls(wiring))), int(rng.random() < 0.6)
        return lambda engine: engine.set_pin(pin, level)
    if kind < 0.5:
        wait_ps = int(rng.integers(0, 5_000_000))
        return lambda engine: engine.run(engine.now_ps + wait_ps)
    made, reach_ps = random_access(rng, wiring)
    return lambda engine: accessed(engine, made, reach_ps)


@needs_compiler
@pytest.mark.parametrize(
    "design",
    [
        CubeStarShared,
        *(pytest.param(top, marks=pytest.mark.slow) for top in WIRINGS if top != CubeStarShared),
    ],
)
def test_all_engines_perform_the_same_bus_transactions(design) -> None:
    """At any time: beside pixels that are stored, in standby, over the ends of segments."""
    rng = np.random.default_rng(7)
    wiring = WIRINGS[design](design(COLUMNS, ROWS))
    all_engines = engines(wiring)
    camera = random_camera(rng, COLUMNS, ROWS)
    assert_same(all_engines, lambda engine: engine.attach(camera), "camera")
    for turn in range(120):
        assert_same(all_engines, random_step(rng, wiring), turn)


@needs_compiler
def test_full_size_bulk_read_equals_pin_by_pin_read_during_a_store() -> None:
    """Beside a picture that is stored in the other memory, at every engine's own speed."""
    wiring = cubestar_double_wiring()
    found = []
    for bulk in (True, False):
        engine = make_engine(wiring, "compiled")
        assert isinstance(engine, CompiledEngine)
        camera = plain_camera(1024, 512, 1, period=100_000, line_clocks=1322, blank=2000)
        engine.attach(camera)
        rng = np.random.default_rng(3)
        engine.memories["SRAM2"][:] = rng.integers(0, 256, 1 << 19, dtype=np.uint8)
        for pin, level in (("RNW", 1), ("INTO", 0), ("ENABLE", 1), ("RNW", 0)):
            engine.set_pin(pin, level)
        places = rng.integers(0, 1 << 19, 4000) | 1 << 19
        read = transactions(places)
        way = CompiledEngine._access if bulk else RtlEngine._access
        with patch.object(CompiledEngine, "_access", way):
            assert engine.access(read, 10**12) == len(places)
        assert np.array_equal(read.data, engine.memories["SRAM2"][places & (1 << 19) - 1])
        engine.run(90 * 10**9, ("ACK", 1))
        assert np.array_equal(engine.memories["SRAM1"].reshape(512, 1024), camera.images[0])
        assert not engine.violation_counts
        found.append((engine.now_ps, read.data.tobytes()))
        engine.close()
    assert found[0] == found[1]


@pytest.fixture
def shared() -> RtlEngine:
    kind = "python" if find_compiler() is None else "compiled"
    return make_engine(cubestar_shared_wiring(CubeStarShared(COLUMNS, ROWS)), kind)


def opened(engine: RtlEngine) -> RtlEngine:
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    return engine


def test_bus_write_is_read_back_within_its_time(shared: RtlEngine) -> None:
    opened(shared)
    places, values = np.arange(64), np.arange(64)[::-1] * 3
    write = transactions(places, values)
    assert shared.access(write, 10**9) == 64
    assert shared.now_ps == int(64 * 8 * CYCLE)
    read = transactions(places)
    assert shared.access(read, 10**9) == 64
    assert np.array_equal(read.data, values)
    assert np.array_equal(shared.sram, values)
    assert not shared.violation_counts


def test_bus_access_performs_only_transactions_that_fit(shared: RtlEngine) -> None:
    opened(shared)
    read = transactions(np.arange(64))
    assert shared.access(read, int(10 * read.period)) == 10
    assert shared.access(read, shared.now_ps) == 0
    assert shared.access(read.first(0), 10**9) == 0


@pytest.mark.parametrize("bulk", [True, False])
def test_read_with_limit_ends_at_the_first_byte_above_it(shared: RtlEngine, bulk: bool) -> None:
    opened(shared).sram[:] = 6
    shared.sram[[17, 20]] = 7
    read = transactions(np.arange(64), above=6)
    way = type(shared)._access if bulk else RtlEngine._access
    with patch.object(type(shared), "_access", way):
        assert shared.access(read, 10**9) == 18
    assert read.data[17] == 7
    assert not read.data[18:].any()
    assert shared.now_ps == int(18 * read.period)


def test_unanswered_read_returns_the_last_level_of_the_data_lines(shared: RtlEngine) -> None:
    shared.sram[:] = 0xA5
    read = transactions([0x123456])
    assert shared.access(read, 10**9) == 1
    assert read.data[0] == 0x34


def test_read_strobe_too_short_for_the_memory_is_a_violation(shared: RtlEngine) -> None:
    """The limits are those of the memory: a core clock of 100 MHz leaves it 10 ns."""
    opened(shared)
    fast = BusTiming(1, 1, 1, 1, 1)
    read = Transactions(
        np.zeros(1, np.int32), np.zeros(1, np.uint8), False, Fraction(5000), 5, timing=fast
    )
    shared.access(read, 10**9)
    assert shared.violation_counts["read-access"] == 1


def test_bus_access_errors_state_the_accepted_values(shared: RtlEngine) -> None:
    with pytest.raises(ValueError, match="no chip select has number 1; they are CS_N"):
        shared.access(transactions([1], select=1), 10**9)
    with pytest.raises(ValueError, match="CubeStarTop has no external bus"):
        make_engine(cubestar_wiring(CubeStarTop(3, 2)), "python").access(transactions([1]), 10**9)
    with pytest.raises(ValueError, match="takes 6 cycles, not 5"):
        transactions([1], cycles=5)
    with pytest.raises(ValueError, match="2 addresses have 1 bytes: one each"):
        transactions([1, 2], [3])
    with pytest.raises(ValueError, match="contiguous int32"):
        Transactions(np.arange(4)[::2], np.zeros(2, np.uint8), False, CYCLE, 8)
    with pytest.raises(ValueError, match="strobe must be 1 to 63 cycles, not 64"):
        BusTiming(1, 1, 1, 64, 1)


OWN = cubestar_wiring()  # once, as a new one is hashed anew


@pytest.fixture
def wiring() -> Wiring:
    return OWN


@pytest.fixture
def engine(wiring: Wiring) -> Iterator[CompiledEngine]:
    if find_compiler() is None:
        pytest.skip("no C++ compiler")
    engine = CompiledEngine(wiring)
    yield engine
    engine.close()


@pytest.mark.parametrize("wiring", [OWN, cubesense_wiring(CubeSensePair())])
def test_engine_registers_have_the_names_of_the_design(engine: CompiledEngine) -> None:
    assert all(bits > 0 for bits in engine.registers.values())
    names = {name.rsplit(".", 1)[-1] for name in engine.registers}
    assert names > {"row", "column", "store", "ack"}


def test_flipping_any_reader_counter_bit_changes_one_address_bit(engine: CompiledEngine) -> None:
    opened(engine)
    for _ in range(3):
        engine.set_pin("DCLK", 1)
        engine.set_pin("DCLK", 0)
    before = engine.get_pin("SRAM_A")
    for register, shift in (("reader.counter.column", 0), ("reader.counter.row", 10)):
        for bit in range(engine.registers[register]):
            engine.flip(register, bit)
            assert engine.get_pin("SRAM_A") == before ^ 1 << bit + shift
            engine.flip(register, bit)
            assert engine.get_pin("SRAM_A") == before


def test_flipped_counter_bit_shifts_the_addresses_in_mid_transfer(engine: CompiledEngine) -> None:
    memory = next(iter(engine.memories.values())).reshape(-1)
    memory[:] = np.random.default_rng(1).integers(0, 256, memory.size)
    opened(engine)
    sent = np.zeros(40, np.uint8)
    period = Fraction(100_000)
    engine.flip("reader.counter.column", 8, engine.now_ps + 20 * int(period))
    assert engine.strobe_read(sent, period, engine.now_ps + 10**9) == 40
    away = [int(index) for index in range(40) if sent[index] != memory[index]]
    assert away
    assert min(away) in (19, 20, 21)  # all before are those of the addresses before
    assert [*sent[22:]] == [*memory[256 + 22 : 256 + 40]]


def test_registers_in_reset_have_their_reset_value_at_once(engine: CompiledEngine) -> None:
    before = {pin: engine.get_pin(pin) for pin in engine.wiring.output_pins}
    for register, bits in engine.registers.items():
        if register != "bank":
            for bit in range(bits):
                engine.flip(register, bit)
                assert {pin: engine.get_pin(pin) for pin in before} == before, register


def test_rejects_unknown_register_bits_listing_known_ones(engine: CompiledEngine) -> None:
    for register, bit in (("writer.ack", 1), ("writer.ack", -1), ("writer.nack", 0)):
        with pytest.raises(ValueError, match=r"no register bit writer.*reader\.data \(8\)"):
            engine.flip(register, bit)


def test_simulator_reports_unsupported_bit_flips() -> None:
    engine = SimulatedEngine(OWN)
    assert engine.registers == {}
    with pytest.raises(ValueError, match="only the compiled engine"):
        engine.flip("writer.ack", 0)
