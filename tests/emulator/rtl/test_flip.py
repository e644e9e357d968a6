from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubesense.pair import CubeSensePair


@pytest.fixture
def wiring() -> Wiring:
    return cubestar_wiring()


@pytest.fixture
def engine(wiring: Wiring) -> Iterator[CompiledEngine]:
    if find_compiler() is None:
        pytest.skip("no C++ compiler")
    engine = CompiledEngine(wiring)
    yield engine
    engine.close()


@pytest.mark.parametrize("wiring", [cubestar_wiring(), cubesense_wiring(CubeSensePair())])
def test_registers_have_the_names_of_the_design(engine: CompiledEngine) -> None:
    assert all(bits > 0 for bits in engine.registers.values())
    names = {name.rsplit(".", 1)[-1] for name in engine.registers}
    assert names > {"row", "column", "store", "ack"}


def test_every_bit_of_a_running_reader_moves_the_address(engine: CompiledEngine) -> None:
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
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


def test_a_bit_turns_over_in_the_middle_of_a_transfer(engine: CompiledEngine) -> None:
    memory = next(iter(engine.memories.values())).reshape(-1)
    memory[:] = np.random.default_rng(1).integers(0, 256, memory.size)
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
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
    engine = SimulatedEngine(cubestar_wiring())
    assert engine.registers == {}
    with pytest.raises(ValueError, match="only the compiled engine"):
        engine.flip("writer.ack", 0)
