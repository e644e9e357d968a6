"""Flash: programming, erasing, locks, wear, stalls; wait states and the instruction cache."""

import struct
from pathlib import Path

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from tests.emulator.iss.cross_compiler import needs_compiler

from .bench import MS, US, Bench, address_of, asleep, compiled, mask_of

PAGE = 0x8_0000
UNLOCK = 0x1B71


def erased(bench: Bench, page: int = PAGE) -> Bench:
    """Start to erase a page."""
    bench.load("MSC", WRITECTRL=1, ADDRB=page, WRITECMD=mask_of("MSC.WRITECMD.LADDRIM"))
    bench.command("MSC.WRITECMD.ERASEPAGE")
    return bench


def write_word(bench: Bench, address: int, value: int) -> None:
    bench.load("MSC", WRITECTRL=1, ADDRB=address, WRITECMD=mask_of("MSC.WRITECMD.LADDRIM"))
    bench["MSC.WDATA"] = value
    bench.command("MSC.WRITECMD.WRITEONCE")


def test_page_erase_takes_20_ms_and_counts_wear() -> None:
    bench = Bench()
    bench.machine.flash[PAGE : PAGE + 8192] = 0
    erased(bench)
    assert bench.is_set("MSC.STATUS.BUSY")
    assert not bench.is_set("MSC.IF.ERASE")
    bench.run_for(19 * MS)
    assert bench.is_set("MSC.STATUS.BUSY")
    bench.run_for(MS)
    assert not bench.is_set("MSC.STATUS.BUSY")
    assert bench.is_set("MSC.IF.ERASE")
    assert set(bench.machine.flash[PAGE : PAGE + 4096]) == {0xFF}
    assert set(bench.machine.flash[PAGE + 4096 : PAGE + 8192]) == {0}
    erased(bench)
    bench.run_for(21 * MS)
    erasures = [
        (item.value, item.extra) for item in bench.out(OutgoingKind.FLASH) if item.unit == 1
    ]
    assert erasures == [(PAGE, 1), (PAGE, 2)]


def test_word_write_takes_20_us_and_only_clears_bits() -> None:
    bench = Bench()
    write_word(bench, PAGE, 0x1234_5678)
    assert bench.is_set("MSC.STATUS.BUSY")
    bench.run_for(21 * US)
    assert not bench.is_set("MSC.STATUS.BUSY")
    assert bench.is_set("MSC.IF.WRITE")
    assert bench.log() == ""
    write_word(bench, PAGE, 0xFFFF_0000)
    bench.run_for(21 * US)
    assert bench.machine.read(PAGE) == 0x1234_0000
    assert "written without erasure" in bench.log()


def test_sequence_of_words_fills_consecutive_addresses() -> None:
    bench = Bench()
    bench.load("MSC", WRITECTRL=1, ADDRB=PAGE, WRITECMD=mask_of("MSC.WRITECMD.LADDRIM"))
    words = [0x1111_1111, 0x2222_2222, 0x3333_3333]
    for word in words:
        while not bench.is_set("MSC.STATUS.WDATAREADY"):
            bench.run_for(US)
        bench["MSC.WDATA"] = word
        bench.command("MSC.WRITECMD.WRITETRIG")
    bench.run_for(100 * US)
    bench.command("MSC.WRITECMD.WRITEEND")
    assert [bench.machine.read(PAGE + 4 * n) for n in range(4)] == [*words, 0xFFFF_FFFF]


def start_writing(more: int = 0) -> Bench:
    bench = Bench()
    return bench.load(
        "MSC", WRITECTRL=1 | more, ADDRB=PAGE, WRITECMD=mask_of("MSC.WRITECMD.LADDRIM")
    )


def words(bench: Bench, count: int) -> list[int | None]:
    bench.machine.run(bench.now)
    return [bench.machine.read(PAGE + 4 * n) for n in range(count)]


DOUBLE = mask_of("MSC.WRITECTRL.WDOUBLE")
ERASED = 0xFFFF_FFFF


def test_two_words_are_written_in_the_time_of_one_with_wdouble() -> None:
    bench = start_writing(DOUBLE)
    for first in (0x11, 0x33):
        bench["MSC.WDATA"] = first
        assert bench.is_set("MSC.STATUS.WDATAREADY")
        bench["MSC.WDATA"] = first + 1
        assert not bench.is_set("MSC.STATUS.WDATAREADY")
        bench.command("MSC.WRITECMD.WRITEONCE")
        assert bench.is_set("MSC.STATUS.BUSY")
        bench.run_for(21 * US)
        assert not bench.is_set("MSC.STATUS.BUSY")
    assert words(bench, 5) == [0x11, 0x12, 0x33, 0x34, ERASED]


def test_single_word_with_wdouble_leaves_the_other_one_erased() -> None:
    bench = start_writing(DOUBLE)
    bench["MSC.WDATA"] = 0x11
    bench.command("MSC.WRITECMD.WRITEONCE")
    bench.run_for(21 * US)
    assert words(bench, 2) == [0x11, ERASED]


@pytest.mark.parametrize("double", [0, DOUBLE])
@pytest.mark.parametrize("again", [False, True], ids=["one trigger", "a trigger for each write"])
def test_sequence_writes_data_as_soon_as_it_is_loaded(double: int, again: bool) -> None:
    bench = start_writing(double)
    data = [0x1000 + n for n in range(8)]
    each = 2 if double else 1
    for index, word in enumerate(data):
        for _ in range(40):
            if bench.is_set("MSC.STATUS.WDATAREADY"):
                break
            bench.run_for(US)
        bench["MSC.WDATA"] = word
        if index % each == each - 1 and (again or index < each):
            bench.command("MSC.WRITECMD.WRITETRIG")
    began = bench.now
    while bench.is_set("MSC.STATUS.BUSY"):
        bench.run_for(US)
    assert 30 * US < bench.now - began < 75 * US
    assert bench.is_set("MSC.STATUS.WORDTIMEOUT")
    assert words(bench, 9) == [*data, ERASED]


def test_word_that_misses_the_time_out_of_a_sequence_needs_a_new_trigger() -> None:
    bench = start_writing()
    bench["MSC.WDATA"] = 1
    bench.command("MSC.WRITECMD.WRITETRIG")
    bench.run_for(60 * US)
    assert not bench.is_set("MSC.STATUS.BUSY")
    bench["MSC.WDATA"] = 2
    bench.run_for(60 * US)
    assert words(bench, 2) == [1, ERASED]
    assert bench.is_set("MSC.STATUS.WORDTIMEOUT")
    bench.command("MSC.WRITECMD.WRITETRIG")
    assert not bench.is_set("MSC.STATUS.WORDTIMEOUT")
    bench.run_for(21 * US)
    bench.command("MSC.WRITECMD.WRITEEND")
    assert not bench.is_set("MSC.STATUS.BUSY")
    bench.run_for(60 * US)
    assert not bench.is_set("MSC.STATUS.WORDTIMEOUT")
    assert words(bench, 2) == [1, 2]


def test_dma_supplies_the_words_of_a_sequence() -> None:
    bench = asleep(1).load("MSC", WRITECTRL=1, ADDRB=PAGE, WRITECMD=mask_of("MSC.WRITECMD.LADDRIM"))
    data = [0x2000 + n for n in range(6)]
    bench.machine.poke(0x2000_1000, struct.pack("<6I", *data))
    bench["MSC.WDATA"] = data[0]
    bench.command("MSC.WRITECMD.WRITETRIG")
    basic = 3 << 30 | 2 << 28 | 2 << 26 | 2 << 24 | 4 << 4 | 1  # five words to a fixed address
    bench.dma(0, 48 << 16, 0x2000_1000 + 20, address_of("MSC.WDATA"), basic)
    bench.run_for(300 * US)
    assert words(bench, 7) == [*data, ERASED]


def test_write_needs_wren_and_unlocked_registers() -> None:
    bench = Bench()
    for name, value in (("MSC.WDATA", 0), ("MSC.WRITECMD", 8)):
        bench[name] = value
        assert f"{name[4:]} without WRITECTRL.WREN" in bench.log()
    bench["MSC.LOCK"] = 0
    assert bench["MSC.LOCK"] == 1
    write_word(bench, PAGE, 0)
    assert not bench.is_set("MSC.STATUS.BUSY")
    bench["MSC.LOCK"] = UNLOCK
    write_word(bench, PAGE, 0)
    assert bench.is_set("MSC.STATUS.BUSY")


@pytest.mark.parametrize("address", [0x10_0000, 0x2000_0000, 0x0FE0_8000])
def test_address_outside_the_flash_is_invalid(address: int) -> None:
    bench = Bench()
    write_word(bench, address, 0)
    assert bench.is_set("MSC.STATUS.INVADDR")
    assert not bench.is_set("MSC.STATUS.BUSY")


def test_lock_bits_protect_their_page() -> None:
    bench = Bench()
    write_word(bench, 0x0FE0_4000 + 4 * (128 // 32), 0xFFFF_FFFE)  # page 128 is at 0x80000
    bench.run_for(21 * US)
    erased(bench)
    assert bench.is_set("MSC.STATUS.LOCKED")
    assert not bench.is_set("MSC.STATUS.BUSY")
    erased(bench, PAGE + 4096)
    assert bench.is_set("MSC.STATUS.BUSY")


def test_user_data_page_can_be_written_and_erased() -> None:
    bench = Bench()
    write_word(bench, 0x0FE0_0010, 0x5555_AAAA)
    bench.run_for(21 * US)
    assert bench.machine.read(0x0FE0_0010) == 0x5555_AAAA
    erased(bench, 0x0FE0_0000)
    bench.run_for(21 * MS)
    assert bench.machine.read(0x0FE0_0010) == 0xFFFF_FFFF


def test_code_in_flash_stalls_while_the_flash_is_busy() -> None:
    bench = Bench()
    erased(bench)
    count = bench.machine.instructions
    bench.run_for(19 * MS)
    assert bench.machine.instructions - count < 5
    bench.run_for(2 * MS)
    assert bench.machine.instructions - count > 1000


def test_bus_writes_to_the_flash_are_ignored_or_a_fault() -> None:
    bench = Bench()
    assert bench.machine.write(PAGE, 0)
    assert bench.machine.read(PAGE) == 0xFFFF_FFFF
    bench["MSC.CTRL"] = 0
    assert not bench.machine.write(PAGE, 0)


FROM_RAM = """
static volatile uint32_t ticks;
IN_RAM static void put(uint32_t address, uint32_t word) {
    MSC->WRITECTRL = MSC_WRITECTRL_WREN;
    MSC->ADDRB = address;
    MSC->WRITECMD = MSC_WRITECMD_LADDRIM;
    if (MSC->STATUS & (MSC_STATUS_INVADDR | MSC_STATUS_LOCKED))
        return;
    while (!(MSC->STATUS & MSC_STATUS_WDATAREADY)) ;
    MSC->WDATA = word;
    MSC->WRITECMD = MSC_WRITECMD_WRITEONCE;
    while (MSC->STATUS & MSC_STATUS_BUSY)
        ticks++;
    MSC->WRITECTRL = 0;
}
int main(void) {
    MSC->LOCK = 0x1B71;
    for (uint32_t n = 0; n < 8; n++)
        put(0x80000 + 4 * n, n * 0x01010101u);
    RESULT[0] = ticks;
    RESULT[1] = 1;
    return 0;
}
"""


@needs_compiler
def test_program_in_ram_runs_while_it_writes_the_flash(tmp_path: Path) -> None:
    bench = Bench(image=compiled(FROM_RAM, tmp_path))
    began = bench.now
    bench.run_for(MS)
    assert bench.machine.read(0x2001_0004) == 1
    assert [bench.machine.read(PAGE + 4 * n) for n in range(8)] == [
        n * 0x0101_0101 for n in range(8)
    ]
    ticks = bench.machine.read(0x2001_0000)
    assert ticks is not None
    assert 100 < ticks < 8 * 20 * 14 // 5  # it polled during all writes
    times = [item.time_ps for item in bench.out(OutgoingKind.FLASH)]
    assert len(times) == 8
    assert 8 * 20 * US < times[-1] + 20 * US - began < 8 * 28 * US


# -- reading ---------------------------------------------------------------------------------------

NOP = 0xBF00


def cycles_of_a_loop(*, mode: int, disabled: bool = False, nops: int = 40) -> float:
    """Cycles per instruction of a loop of ``nops`` (1 cycle each) and a branch."""
    branch = 0xE000 | (-(nops + 2) & 0x7FF)
    bench = Bench(*[NOP] * nops, branch)
    bench["MSC.READCTRL"] = mode | disabled << 3
    bench.run_for(100 * US)
    count, cycles = bench.machine.instructions, bench.machine.cycles
    bench.run_for(1000 * US)
    return (bench.machine.cycles - cycles) / (bench.machine.instructions - count)


def test_wait_states_cost_nothing_inside_the_cache() -> None:
    assert cycles_of_a_loop(mode=4) == pytest.approx(cycles_of_a_loop(mode=0), rel=1e-3)


@pytest.mark.parametrize(
    ("nops", "mode", "disabled", "least", "most"),
    [
        pytest.param(40, 0, True, 1, 1.1, id="no cache, no wait states"),
        pytest.param(40, 4, True, 1.35, 1.65, id="no cache: 3 cycles per word of 2 instructions"),
        pytest.param(200, 4, False, 1, 1.1, id="loop in the cache"),
        pytest.param(500, 4, False, 1.3, 1.65, id="loop larger than the cache of 512 bytes"),
    ],
)
def test_cycles_per_instruction_depend_on_wait_states_and_cache(
    nops: int, mode: int, disabled: bool, least: float, most: float
) -> None:
    assert least <= cycles_of_a_loop(mode=mode, disabled=disabled, nops=nops) < most


def test_performance_counters_count_hits_and_misses() -> None:
    bench = Bench(*[NOP] * 40, 0xE000 | (-42 & 0x7FF))
    bench["MSC.READCTRL"] = 1
    bench.command("MSC.CMD.INVCACHE")
    bench.command("MSC.CMD.STARTPC")
    assert bench.is_set("MSC.STATUS.PCRUNNING")
    bench.run_for(100 * US)
    bench.command("MSC.CMD.STOPPC")
    hits, misses = bench["MSC.CACHEHITS"], bench["MSC.CACHEMISSES"]
    assert 20 <= misses <= 24
    assert hits > 500
    bench.run_for(100 * US)
    assert bench["MSC.CACHEHITS"] == hits


def test_data_access_to_the_flash_has_its_wait_states() -> None:
    bench = Bench()

    def cost(mode: int) -> int:
        bench["MSC.READCTRL"] = mode
        before = bench.machine.cycles
        bench.machine.read(PAGE)
        return bench.machine.cycles - before

    assert cost(4) - cost(0) == 2
    assert cost(1) - cost(0) == 1
