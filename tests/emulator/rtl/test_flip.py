"""Registers that are turned over from outside."""

import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.cxxrtl.build import find_compiler
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubesense.pair import CubeSensePair

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@needs_compiler
@pytest.mark.parametrize("wiring", [cubestar_wiring(), cubesense_wiring(CubeSensePair())])
def test_registers_have_the_names_of_the_design(wiring: Wiring) -> None:
    engine = CompiledEngine(wiring)
    registers = engine.registers
    assert all(bits > 0 for bits in registers.values())
    assert {name.rsplit(".", 1)[-1] for name in registers} > {"row", "column", "store", "ack"}
    engine.close()


@needs_compiler
def test_every_bit_of_a_running_reader_moves_the_address() -> None:
    engine = CompiledEngine(cubestar_wiring())
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
    engine.close()


@needs_compiler
def test_registers_in_reset_have_their_reset_value_at_once() -> None:
    engine = CompiledEngine(cubestar_wiring())
    before = {pin: engine.get_pin(pin) for pin in engine.wiring.output_pins}
    for register, bits in engine.registers.items():
        if register != "bank":
            for bit in range(bits):
                engine.flip(register, bit)
                assert {pin: engine.get_pin(pin) for pin in before} == before, register
    engine.close()


@needs_compiler
def test_what_is_no_register_bit_is_refused_with_those_there_are() -> None:
    engine = CompiledEngine(cubestar_wiring())
    for register, bit in (("writer.ack", 1), ("writer.ack", -1), ("writer.nack", 0)):
        with pytest.raises(ValueError, match=r"no register bit writer.*reader\.data \(8\)"):
            engine.flip(register, bit)
    engine.close()


def test_the_simulator_says_that_it_can_not() -> None:
    engine = SimulatedEngine(cubestar_wiring())
    assert engine.registers == {}
    with pytest.raises(ValueError, match="only the compiled engine"):
        engine.flip("writer.ack", 0)
