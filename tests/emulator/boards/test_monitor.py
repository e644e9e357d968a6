from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards.monitor import Monitor, RegisterValue, peek, peripherals
from cubestack.emulator.iss.insight.symbols import Symbol, Symbols
from cubestack.firmware_model.interface.efm32gg import LAYOUTS


def monitor(engine: object) -> Monitor:
    board: Any = SimpleNamespace(engine=engine)
    return Monitor(board, Symbols(None))


def test_pins_are_those_of_the_processor_and_the_outputs() -> None:
    wiring = SimpleNamespace(mcu_pins=("ENABLE", "RNW"), output_pins=("ACK", "DATA"))
    levels = {"ENABLE": 1, "RNW": 0, "ACK": 1, "DATA": 0x5A}
    engine = SimpleNamespace(wiring=wiring, get_pin=levels.__getitem__)
    assert monitor(engine)(["pins"]) == "ENABLE 0x1\nRNW 0x0\nACK 0x1\nDATA 0x5a"
    assert monitor(None)(["pins"]) == "no FPGA"


def test_rejects_unknown_pin_commands() -> None:
    with pytest.raises(ValueError, match="no command 'pin'; known: reset, catch, help, time"):
        monitor(None)(["pin"])


RAM = 0x2000_0000


class Memory:
    """Words that tell their own addresses; nothing from 0x6000_0000 on."""

    def peek(self, address: int, count: int) -> bytes:
        assert address % 4 == 0
        return b"" if address >= 0x6000_0000 else address.to_bytes(4, "little")[:count]


def look(what: str, **variables: Symbol) -> list[RegisterValue]:
    symbols, memory = Symbols(None), Memory()
    symbols.variables |= variables
    machine: Any = memory
    return peek(machine, symbols, what)


@pytest.mark.parametrize("offset", [0, 1, 2, 3])
def test_an_address_is_that_of_its_word(offset: int) -> None:
    for what in (hex(RAM + 8 + offset), str(RAM + 8 + offset)):
        assert look(what) == [RegisterValue("20000008", RAM + 8, {})]


def test_variable_covers_every_word_it_touches() -> None:
    for address, size, words in ((RAM, 4, 1), (RAM + 3, 1, 1), (RAM + 3, 2, 2), (RAM, 9, 3)):
        found = look("it", it=Symbol("it", address, size))
        assert [one.value for one in found] == [RAM + 4 * n for n in range(words)]
        assert found[0].name == "it 20000000"


def test_a_register_has_its_fields_and_a_peripheral_all_registers() -> None:
    assert {"CMU", "MSC", "USART0"} <= set(peripherals())
    for layout in LAYOUTS:
        for instance in layout.instances:
            found = look(instance.name)
            assert [one.name for one in found] == [
                f"{instance.name}.{register.name}" for register in layout.registers
            ]
            for one, register in zip(found, layout.registers, strict=True):
                assert one.value == instance.base + register.offset
                for field in register.fields:
                    if field.name:
                        low = field.mask & -field.mask
                        assert one.fields[field.name] == (one.value & field.mask) // low
    (one,) = look("cmu.ctrl")
    assert one.text.startswith("400c8000")


def test_rejects_unknown_addresses_and_names() -> None:
    (one,) = look("0x60000000")
    assert (one.value, one.text) == (None, "can not be read")
    with pytest.raises(ValueError, match="no peripheral, variable or address 'x'; known: "):
        look("x")
    with pytest.raises(ValueError, match="CMU has no register X; known: CTRL"):
        look("CMU.X")
