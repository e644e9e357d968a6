"""The processor asleep, and in the loop that copies the picture out of the FPGA."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US
from cubestack.firmware_model.mcu.requests import Pay, Sleep, StrobeRead

BOOT_US = 100


# --- sleep -------------------------------------------------------------------------------------


def sleeping(deadline_us: int | None, *, wakeable: bool = True, then: int = 0):
    def body(desk):
        deadline = None if deadline_us is None else deadline_us + BOOT_US
        desk.note((yield Sleep(deadline, wakeable)))
        if then:
            desk.note((yield Sleep(then + BOOT_US)))

    return body


@pytest.mark.parametrize(
    ("sleep", "wakes_us", "log"),
    [
        pytest.param(sleeping(500), [], [(500, False)], id="ends at its deadline"),
        pytest.param(sleeping(500), [200], [(200, True)], id="a wake ends it"),
        pytest.param(
            sleeping(500, wakeable=False, then=900),
            [200],
            [(500, False), (500, True)],
            id="goes on when it is not wakeable, and the wake is kept",
        ),
        pytest.param(
            sleeping(500, then=900),
            [-BOOT_US],
            [(0, True), (900, False)],
            id="a wake before it is not lost",
        ),
        pytest.param(
            sleeping(500, then=900), [100, 100], [(100, True), (900, False)], id="two wakes end one"
        ),
        pytest.param(
            sleeping(0, then=900),
            [-BOOT_US],
            [(0, False), (0, True)],
            id="a wake survives one whose deadline has passed",
        ),
    ],
)
def test_sleep_and_wakes(desk_of, sleep, wakes_us, log):
    desk = desk_of(sleep)
    for us in wakes_us:
        desk.at(us, desk.processor.wake)
    assert desk.run().log == log


def test_sleep_without_deadline_waits_for_a_wake(desk_of):
    desk = desk_of(sleeping(None))
    desk.run(1000)
    assert not desk.log
    assert desk.processor.waiting
    desk.at(2000, desk.processor.wake)
    assert desk.run().log == [(2000, True)]


def test_wake_at_the_deadline_is_told_once(desk_of):
    desk = desk_of(sleeping(500, then=900))
    desk.at(500, desk.processor.wake)
    desk.run()
    assert sorted(answer for _, answer in desk.log) == [False, True]


def test_sleep_that_nothing_can_end(desk_of):
    with pytest.raises(ValueError, match="give a deadline or make it wakeable"):
        desk_of(sleeping(None, wakeable=False)).run()


def test_activity_is_told(desk_of):
    desk = desk_of(sleeping(500, then=900)).run()
    assert desk.activity == [
        (-BOOT_US, True), (0, False), (500, True), (500, False), (900, True), (900, False)
    ]  # fmt: skip


def test_waiting_means_a_sleep_without_deadline(desk_of):
    desk = desk_of(sleeping(500))
    assert not desk.processor.waiting
    desk.run(499)
    assert not desk.processor.waiting
    desk.run(501)
    assert desk.processor.waiting


def test_dozing_means_a_sleep_that_an_interrupt_ends(desk_of):
    def body(desk):
        yield Sleep(BOOT_US + 500, wakeable=False)
        yield Sleep(BOOT_US + 900)

    desk = desk_of(body)
    for us, dozing in ((499, False), (501, True), (899, True)):
        assert desk.run(us).processor.dozing is dozing


def test_interrupts_during_a_sleep_are_paid_afterwards(desk_of):
    def body(desk):
        yield Sleep(500 + BOOT_US)
        yield Pay()
        desk.note()

    desk = desk_of(body)
    desk.at(200, lambda: desk.work(30))
    assert desk.run().log == [(530, None)]


# --- transfer loop -----------------------------------------------------------------------------

CYCLES = 38
HZ = 48_000_000  # 38 cycles are 791 666 2/3 ps


def transfer(count: int, target: list[Any]):
    def body(desk):
        out = np.zeros(count, np.uint8)
        target.append(out)
        start = desk.kernel.now
        yield StrobeRead(out, CYCLES)
        desk.note(desk.kernel.now - start)

    return body


def exact_ps(cycles: int) -> int:
    return cycles * PS_PER_S // HZ


@pytest.mark.parametrize("interruptions", [[], [1], [5, 6, 7], list(range(1, 200, 3))])
def test_transfer_takes_its_cycles_whatever_happens_in_between(desk_of, interruptions):
    target = []
    desk = desk_of(transfer(1000, target), hz=HZ)
    for us in interruptions:
        desk.at(us, lambda: None)
    desk.run(10_000)
    assert desk.log[0][1] == exact_ps(1000 * CYCLES)
    assert np.array_equal(target[0], np.arange(1000) % 256)


def test_interrupts_steal_cycles_from_a_transfer(desk_of):
    desk = desk_of(transfer(1000, []), hz=HZ)
    for us in (10, 11, 300):
        desk.at(us, lambda: desk.work(80))
    desk.run(10_000)
    # Where an interrupt breaks the loop, a fraction of a picosecond is lost.
    assert desk.log[0][1] == pytest.approx(exact_ps(1000 * CYCLES + 3 * 80), abs=8)


def test_events_shorter_than_a_loop_turn_do_not_stop_it(desk_of):
    """Every half turn something happens: the loop still makes one turn at a time."""
    desk = desk_of(transfer(50, []), hz=HZ)
    step = exact_ps(CYCLES // 2)
    for index in range(120):
        desk.kernel.timeout(BOOT_US * PS_PER_US + index * step)
    desk.run(10_000)
    assert desk.log[0][1] == exact_ps(50 * CYCLES)


def test_work_before_a_transfer_is_done_before_it(desk_of):
    def body(desk):
        desk.work(481)
        yield StrobeRead(np.zeros(10, np.uint8), CYCLES)
        desk.note(desk.kernel.now - BOOT_US * PS_PER_US)

    desk = desk_of(body, hz=HZ).run(10_000)
    assert desk.log[0][1] == pytest.approx(exact_ps(481 + 10 * CYCLES), abs=1)


def test_empty_transfer(desk_of):
    desk = desk_of(transfer(0, []), hz=HZ).run(10_000)
    assert desk.log == [(0, 0)]
