"""Flash and RAM in use, compared with the ELF file and with bytes that the test changes."""

import io
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.insight.reports import memory_use
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import RAM_BASE, Machine

RUN_PS = 10**9
RAM_BYTES = 128 * 1024
HEAP_BYTES = 100


@pytest.fixture
def observer(machine: Machine, symbols: Symbols) -> Observer:
    observer = Observer(machine, symbols)
    while machine.now_ps < RUN_PS:
        machine.run(RUN_PS)
        list(machine.outbox())
    return observer


def write(observer: Observer, address: int) -> None:
    observer.machine.ram[address - RAM_BASE] ^= 0x55


def test_flash_and_static_data_are_those_of_the_elf_file(observer: Observer, program: Path) -> None:
    elf = ELFFile(io.BytesIO(program.read_bytes()))
    sections = [part for part in elf.iter_sections() if part["sh_flags"] & 2]  # SHF_ALLOC
    in_ram = [part for part in sections if part["sh_addr"] >= RAM_BASE]
    end = max(part["sh_addr"] + part["sh_size"] for part in in_ram)
    in_flash = sum(part["sh_size"] for part in sections if part["sh_type"] == "SHT_PROGBITS")
    use = memory_use(observer)
    assert (use.flash_size, use.ram_size, use.flash) == (1 << 20, RAM_BYTES, in_flash)
    assert use.static == end - RAM_BASE
    main_sp = observer.figures().main_sp
    assert main_sp is not None
    assert use.stack == RAM_BASE + RAM_BYTES - main_sp
    assert (use.heap, use.process_stack) == (0, None)
    assert use.static + use.free + use.stack == RAM_BYTES
    assert 0 < use.stack < 256


def test_heap_ends_after_the_last_changed_byte(observer: Observer) -> None:
    before = memory_use(observer)
    assert before.static is not None
    assert before.free is not None
    for offset in (HEAP_BYTES - 1, 3):
        write(observer, RAM_BASE + before.static + offset)
    use = memory_use(observer)
    assert (use.heap, use.free) == (HEAP_BYTES, before.free - HEAP_BYTES)
    write(observer, RAM_BASE + before.static + before.free)  # the stack's lowest byte
    assert memory_use(observer) == use
    write(observer, RAM_BASE + before.static + before.free - 1)
    assert memory_use(observer).free == 0


def test_static_data_end_at_the_first_known_symbol(observer: Observer) -> None:
    labels = observer.symbols.labels
    before = labels.copy()
    end = labels.pop("end")
    try:
        use = memory_use(observer)
        assert (use.static, use.heap, use.free) == (None, None, None)
        assert use.stack is not None
        for inside, at in ((True, RAM_BASE), (True, RAM_BASE + RAM_BYTES), (False, RAM_BASE - 1)):
            labels["_ebss"] = at
            assert memory_use(observer).static == (at - RAM_BASE if inside else None)
        labels["_ebss"] = RAM_BASE + RAM_BYTES + 1
        assert memory_use(observer).static is None
        labels["_end"] = end  # preferred
        assert memory_use(observer).static == end - RAM_BASE
    finally:
        labels.clear()
        labels |= before
