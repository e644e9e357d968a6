"""The log of flash changes, worn cells, and the states that power cuts leave."""

import numpy as np
import pytest

from cubestack.emulator.iss.flash_changes import (
    FlashChange,
    FlashContents,
    FlashOperation,
    operations,
)
from tests.emulator.iss.efm32gg.bench import MS, US, Bench, mask_of

PAGE, USER_PAGE = 0x8_0000, 0x0FE0_0000


def write_word(bench: Bench, address: int, *values: int) -> None:
    double = mask_of("MSC.WRITECTRL.WDOUBLE") if len(values) == 2 else 0
    ladd = mask_of("MSC.WRITECMD.LADDRIM")
    bench.load("MSC", WRITECTRL=1 | double, ADDRB=address, WRITECMD=ladd)
    for value in values:
        bench["MSC.WDATA"] = value
    bench.command("MSC.WRITECMD.WRITEONCE")
    bench.run_for(30 * US)


def erase_page(bench: Bench, address: int) -> None:
    ladd = mask_of("MSC.WRITECMD.LADDRIM")
    bench.load("MSC", WRITECTRL=1, ADDRB=address, WRITECMD=ladd)
    bench.command("MSC.WRITECMD.ERASEPAGE")
    bench.run_for(21 * MS)


def logged() -> Bench:
    bench = Bench()
    bench.machine.flash[PAGE : PAGE + 4096] = 0x5A
    bench.machine.log_flash()
    return bench


def word(before: int, after: int) -> FlashOperation:
    return FlashOperation((FlashChange(0, 20, PAGE, 4, before, after, 0, False),))


def erasure() -> FlashOperation:
    return FlashOperation((FlashChange(0, 20, PAGE, 4096, 0, 0xFFFF_FFFF, 0, True),))


def contents() -> FlashContents:
    flash = np.frombuffer(np.random.default_rng(1).bytes(1 << 20), np.uint8).copy()
    return FlashContents(flash, np.full(3 * 4096, 0xFF, np.uint8))


def test_logged_changes_rebuild_the_flash() -> None:
    bench = logged()
    start = FlashContents.of(bench.machine)
    erase_page(bench, PAGE)
    write_word(bench, PAGE + 8, 0x1234_5678)
    write_word(bench, PAGE + 8, 0xFFFF_0000)
    write_word(bench, USER_PAGE + 4, 0xAAAA_5555)
    done = operations(bench.machine.flash_changes())
    assert [(one.first.address, one.erases) for one in done] == [
        (PAGE, True), (PAGE + 8, False), (PAGE + 8, False), (USER_PAGE + 4, False),
    ]  # fmt: skip
    assert (done[2].first.before, done[2].first.after) == (0x1234_5678, 0x1234_0000)
    assert [one.end_ps - one.time_ps for one in done] == [20 * MS, 20 * US, 20 * US, 20 * US]
    assert not start.same_as(bench.machine)
    for one in done:
        start.apply(one)
    assert start.same_as(bench.machine)
    assert bench.machine.flash_changes() == []


def test_two_words_that_are_written_together_are_one_operation() -> None:
    bench = logged()
    erase_page(bench, PAGE)
    bench.machine.flash_changes()
    write_word(bench, PAGE, 1, 2)
    (one,) = operations(bench.machine.flash_changes())
    assert [(change.address, change.after) for change in one.changes] == [(PAGE, 1), (PAGE + 4, 2)]


def test_more_changes_than_one_call_returns_are_complete() -> None:
    bench = logged()
    erase_page(bench, PAGE)
    for number in range(300):
        write_word(bench, PAGE + 4 * number, number)
    changes = bench.machine.flash_changes()[1:]
    assert [one.after for one in changes] == list(range(300))


def test_worn_cells_keep_their_value() -> None:
    bench = logged()
    bench.machine.wear_out(PAGE, 0xFF)
    erase_page(bench, PAGE)
    assert bench.machine.peek(PAGE, 8).hex() == "5affffffffffffff"
    write_word(bench, PAGE, 0)
    assert bench.machine.peek(PAGE, 4).hex() == "5a000000"
    erase, programmed = bench.machine.flash_changes()
    assert erase.erased
    assert programmed.after == 0x5A


def test_torn_word_has_some_of_its_zeros_and_no_others() -> None:
    seen = set()
    for seed in range(50):
        torn = contents()
        torn.flash[PAGE : PAGE + 4] = 0xFF
        torn.tear(word(0xFFFF_FFFF, 0x0F0F_0F0F), 0.5, np.random.default_rng(seed))
        value = int.from_bytes(torn.flash[PAGE : PAGE + 4].tobytes(), "little")
        assert value & 0x0F0F_0F0F == 0x0F0F_0F0F
        seen.add(value)
    assert len(seen) > 40
    assert not seen & {0xFFFF_FFFF, 0x0F0F_0F0F}


def test_torn_erasure_is_a_mixture_of_old_contents_and_ones() -> None:
    before, torn = contents(), contents()
    torn.tear(erasure(), 0.25, np.random.default_rng(3))
    old, new = before.flash[PAGE : PAGE + 4096], torn.flash[PAGE : PAGE + 4096]
    assert np.array_equal(old & new, old)  # no cell lost its charge's absence
    risen = np.unpackbits(new & ~old).sum() / np.unpackbits(~old).sum()
    assert risen == pytest.approx(0.25, abs=0.02)
    new[:] = old
    assert np.array_equal(before.flash, torn.flash)  # other pages are as before


@pytest.mark.parametrize("operation", [word(0xFFFF_FFFF, 0x0F0F_0F0F), erasure()])
def test_torn_at_its_ends_is_before_and_after(operation: FlashOperation) -> None:
    before = contents()
    before.flash[PAGE : PAGE + 4] = 0xFF
    start, end, done = before.copy(), before.copy(), before.copy()
    start.tear(operation, 0.0, np.random.default_rng(0))
    end.tear(operation, 1.0, np.random.default_rng(0))
    done.apply(operation)
    assert np.array_equal(start.flash, before.flash)
    assert np.array_equal(end.flash, done.flash)
