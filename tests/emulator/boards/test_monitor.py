import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.debugging import REGIONS, CameraWindow, windows
from cubestack.emulator.boards.monitor import Monitor, RegisterValue, peek, peripherals
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.iss.insight.symbols import Symbol, Symbols
from cubestack.emulator.iss.machine import FLASH_BYTES, RAM_BYTES
from cubestack.firmware_model.interface.cameras import mlx75412
from cubestack.firmware_model.interface.efm32gg import LAYOUTS


def monitor(engine: object) -> Monitor:
    board: Any = SimpleNamespace(engine=engine, pins=None)
    return Monitor(board, Symbols(None))


def test_monitor_pins_lists_processor_and_output_pins() -> None:
    wiring = SimpleNamespace(mcu_pins=("ENABLE", "RNW"), output_pins=("ACK", "DATA"))
    levels = {"ENABLE": 1, "RNW": 0, "ACK": 1, "DATA": 0x5A}
    engine = SimpleNamespace(wiring=wiring, get_pin=levels.__getitem__)
    assert monitor(engine)(["pins"]) == "ENABLE 0x1\nRNW 0x0\nACK 0x1\nDATA 0x5a"
    assert monitor(None)(["pins"]) == "no FPGA"
    with pytest.raises(ValueError, match=r"no command 'pin'; known: catch, halt, .*, help, time"):
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
def test_address_lookup_shows_the_word_that_contains_it(offset: int) -> None:
    for what in (hex(RAM + 8 + offset), str(RAM + 8 + offset)):
        assert look(what) == [RegisterValue("20000008", RAM + 8, {})]


def test_variable_covers_every_word_it_touches() -> None:
    for address, size, words in ((RAM, 4, 1), (RAM + 3, 1, 1), (RAM + 3, 2, 2), (RAM, 9, 3)):
        found = look("it", it=Symbol("it", address, size))
        assert [one.value for one in found] == [RAM + 4 * n for n in range(words)]
        assert found[0].name == "it 20000000"


def test_register_lookup_shows_fields_and_all_registers_of_a_peripheral() -> None:
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


LENGTHS = {region.start: region.length for region in REGIONS}


def test_debugger_memory_map_matches_the_part() -> None:
    """EFM32GG Reference Manual, figure 5.2: RAM is in the code space too, and bit by bit."""
    assert LENGTHS[0] == FLASH_BYTES == 1 << 20
    assert LENGTHS[0x1000_0000] == LENGTHS[0x2000_0000] == RAM_BYTES == 128 * 1024
    assert LENGTHS[0x2200_0000] == 32 * RAM_BYTES
    assert LENGTHS[0x8000_0000] == 4 * (64 << 20)  # the banks of the external bus
    assert LENGTHS[0xE000_0000] == 0x10_0000
    (flash,) = [region for region in REGIONS if region.kind == "flash"]
    assert flash.block == 4096


def test_each_peripheral_and_information_page_is_in_a_region() -> None:
    places = [instance.base for layout in LAYOUTS for instance in layout.instances]
    for place in (*places, 0x0FE0_0000, 0x0FE0_4000, 0x0FE0_8000, 0x0FE0_81FC):
        assert any(start <= place < start + length for start, length in LENGTHS.items())
    ends = sorted((region.start, region.start + region.length) for region in REGIONS)
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(ends))
    assert ends[-1][1] <= 1 << 32


@pytest.mark.parametrize("count", [None, 1, 2])
def test_debugger_windows_include_fpga_memories_and_camera_registers(count: int | None) -> None:
    registers = RegisterFile(mlx75412.REGISTERS)
    memories = [np.arange(size, dtype=np.uint8) for size in (200, 100)][: count or 0]
    engine = SimpleNamespace(memories={str(n): memory for n, memory in enumerate(memories)})
    board: Any = SimpleNamespace(
        engine=None if count is None else engine, camera=SimpleNamespace(registers=registers)
    )
    found = windows(board)
    starts = {region.start: (region.kind, region.length) for region in found}
    expected = {0xC000_0000 + n * 0x0100_0000: ("ram", m.size) for n, m in enumerate(memories)}
    assert starts == expected | {0xD000_0000: ("rom", 65_536)}
    for region, window in found.items():
        if region.kind == "ram":
            assert window.read(3, 4) == bytes((3, 4, 5, 6))
            assert window.write(3, b"\x63")
    assert all(memory[3] == 0x63 for memory in memories)


def test_debugger_reads_but_does_not_write_camera_registers() -> None:
    registers = RegisterFile(mlx75412.REGISTERS)
    window = CameraWindow(registers)
    (first, *_) = mlx75412.REGISTERS["EXPOSURE"].addresses
    registers.store("EXPOSURE", 0x1234)
    assert window.read(first, 2) == b"\x12\x34"
    assert not window.write(first, b"\0\0")
    assert window.read(first, 2) == b"\x12\x34"
    assert window.read(0xFFFF, 3) == bytes(3)
