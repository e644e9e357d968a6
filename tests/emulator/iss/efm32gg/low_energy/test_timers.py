"""RTC and LETIMER: counts, compare values, repeats, and waking from EM2."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.iss.outcome import OutgoingKind

from ..bench import MS, US, Bench, S, mask_of
from .domain import HZ, LETIMER_IRQ, NOT_PENDING, PD6, PUSH_PULL, TICK, low


def rtc(*, interrupts: bool = False, **registers: int) -> Bench:
    return low(2, "RTC", interrupts=interrupts).load("RTC", **registers)


def test_rtc_compare_match_wakes_from_em2_at_its_time() -> None:
    bench = rtc(interrupts=True, COMP0=3276, IEN=2)
    began = bench.now
    bench["RTC.CTRL"] = 1
    bench.out(OutgoingKind.SLEEP)
    bench.run_until(began + 3276 * S // HZ - TICK)
    assert not bench.out(OutgoingKind.SLEEP)
    bench.run_for(3 * TICK)
    first = bench.out(OutgoingKind.SLEEP)[0]
    assert first.value == 0
    assert abs(first.time_ps - began - 3276 * S // HZ) <= TICK
    assert bench["RTC.IF"] & 2


def test_rtc_overflows_after_24_bits() -> None:
    bench = rtc(CTRL=1, CNT=0xFF_FFF0)
    bench.run_for(15 * S // HZ)
    assert bench["RTC.IF"] == 0
    bench.run_for(2 * TICK)
    assert bench["RTC.IF"] & 1


def test_disabling_the_rtc_clears_its_count() -> None:
    bench = rtc(CTRL=1)
    bench.run_for(MS)
    bench["RTC.CTRL"] = 0
    assert bench["RTC.CNT"] == 0
    bench["RTC.CTRL"] = 1
    assert bench["RTC.CNT"] <= 1


def test_synchronisation_takes_two_to_three_clocks_and_waits_while_frozen() -> None:
    bench = rtc(COMP1=5)
    assert bench["RTC.SYNCBUSY"] == 4
    bench.run_for(2 * S // HZ - TICK // 10)
    assert bench["RTC.SYNCBUSY"] == 4
    bench.run_for(TICK + TICK // 5)
    assert bench["RTC.SYNCBUSY"] == 0
    bench.load("RTC", FREEZE=1, COMP1=6)
    bench.run_for(MS)
    assert (bench["RTC.SYNCBUSY"], bench["RTC.COMP1"]) == (4, 5)
    bench["RTC.FREEZE"] = 0
    bench.run_for(MS)
    assert (bench["RTC.SYNCBUSY"], bench["RTC.COMP1"]) == (0, 6)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 70),
    st.integers(0, 70),
    st.booleans(),
    st.booleans(),
    st.lists(st.integers(0, 200), min_size=1, max_size=5),
)
def test_rtc_counts_like_a_stepped_counter(
    compare0: int, compare1: int, is_top: bool, watched: bool, waits: list[int]
) -> None:
    bench = rtc(COMP0=compare0, COMP1=compare1, IEN=7 if watched else 0)
    bench.run_for(5 * TICK)
    bench["RTC.CTRL"] = 5 if is_top else 1
    while not bench.peek("RTC.CNT"):  # until just after an edge
        bench.run_for(TICK // 16)
    value = bench["RTC.CNT"]
    flags = bench["RTC.IF"]
    for wait in waits:
        bench.run_for(wait * S // HZ)
        for _ in range(wait):
            top = compare0 if is_top else 0xFF_FFFF
            flags |= (2 if value == compare0 else 0) | (4 if value == compare1 else 0)
            value = 0 if value == top else value + 1
        assert (bench["RTC.CNT"], bench["RTC.IF"]) == (value, flags)


def test_compare_flag_comes_when_the_counter_leaves_the_compare_value() -> None:
    bench = rtc(COMP0=9, COMP1=4, CTRL=5)
    last: dict[int, int] = {}  # count by flags
    for _ in range(8 * 12):
        flags = bench["RTC.IF"]
        last[flags] = bench["RTC.CNT"]
        if flags & 2:
            break
        bench.run_for(TICK // 8)
    assert last == {0: 4, 4: 9, 6: 0}


@pytest.mark.parametrize("compare", [0, 1])
def test_compare_value_equal_to_the_counter_at_the_start_matches(compare: int) -> None:
    bench = rtc(**{"COMP0": 0xFFFF, "COMP1": 0xFFFF, f"COMP{compare}": 0})
    bench["RTC.CTRL"] = 1
    bench.run_for(2 * TICK)
    assert bench["RTC.IF"] == 2 << compare
    bench["RTC.IFC"] = 7
    bench[f"RTC.COMP{compare}"] = bench["RTC.CNT"]
    bench.run_for(2 * TICK)
    assert bench["RTC.IF"] == 2 << compare


# -- LETIMER --

TOP = mask_of("LETIMER.CTRL.COMP0TOP")


def letimer(control: int = 0, *, interrupts: bool = False, **registers: int) -> Bench:
    bench = low(2, "LETIMER0", interrupts=interrupts)
    bench["GPIO.PD_MODEL"] = PUSH_PULL << 24 | PUSH_PULL << 28
    return bench.load("LETIMER0", CTRL=control, **registers)


def letimer_runs(bench: Bench) -> bool:
    return bench.is_set("LETIMER0.STATUS.RUNNING")


def test_letimer_counts_down_from_its_top() -> None:
    bench = letimer(TOP, COMP0=99, CMD=1)
    assert letimer_runs(bench)
    bench.run_for(3 * TICK)
    assert bench["LETIMER0.CNT"] in (96, 97, 98)
    assert bench["LETIMER0.IF"] & 4  # from 0 the first clock is an underflow
    bench["LETIMER0.IFC"] = 0x1F
    bench.run_for(99 * S // HZ)
    assert bench["LETIMER0.IF"] & 4


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 40),
    st.integers(0, 45),
    st.booleans(),
    st.lists(st.integers(0, 120), min_size=1, max_size=5),
)
def test_letimer_counts_like_a_stepped_counter(
    compare0: int, compare1: int, watched: bool, waits: list[int]
) -> None:
    bench = letimer(TOP, COMP0=compare0, COMP1=compare1, IEN=7 if watched else 0, CMD=1)
    while not bench["LETIMER0.CNT"]:  # until just after the first edge
        bench.run_for(TICK // 16)
    value = bench["LETIMER0.CNT"]
    bench["LETIMER0.IFC"] = 0x1F
    flags = 0
    for wait in waits:
        bench.run_for(wait * S // HZ)
        for _ in range(wait):
            flags |= (1 if value == compare0 else 0) | (2 if value == compare1 else 0)
            flags |= 0 if value else 4
            value = value - 1 if value else compare0
        assert (bench["LETIMER0.CNT"], bench["LETIMER0.IF"]) == (value, flags)


def test_letimer_wakes_from_em2_each_period() -> None:
    bench = letimer(TOP, interrupts=True, COMP0=327, IEN=4, CMD=1)
    times = []
    bench.out(OutgoingKind.SLEEP)
    for _ in range(5):
        while not bench.peek("LETIMER0.IF") & 4:
            bench.run_for(TICK // 2)
        times.append(bench.out(OutgoingKind.SLEEP)[0].time_ps)
        bench["LETIMER0.IFC"] = 4
        bench.machine.write(NOT_PENDING, 1 << LETIMER_IRQ)
        bench.run_for(10 * US)
        bench.out(OutgoingKind.SLEEP)
    for n in range(4):
        assert abs(times[n + 1] - times[n] - 328 * S // HZ) <= 2 * US


@pytest.mark.parametrize(
    ("mode", "repeats", "first", "left", "second", "flag"),
    [(1, {"REP0": 3}, 15, 1, 20, 8), (2, {"REP0": 1, "REP1": 2}, 5, 2, 30, 0x10)],
    ids=["one-shot", "buffered"],
)
def test_letimer_stops_after_its_repeats(
    mode: int, repeats: dict[str, int], first: int, left: int, second: int, flag: int
) -> None:
    bench = letimer(TOP | mode, COMP0=9, **repeats, CMD=1)
    bench.run_for(first * TICK)
    assert letimer_runs(bench)
    assert bench["LETIMER0.REP0"] == left
    bench.run_for(second * TICK)
    assert not letimer_runs(bench)
    assert bench["LETIMER0.IF"] & flag


def test_letimer_pwm_drives_its_pin() -> None:
    bench = letimer(TOP | 3 << 2, COMP0=99, COMP1=25, REP0=1, ROUTE=1, CMD=1)
    bench.run_for(350 * TICK)
    found = bench.pins(PD6)
    rises = [time for time, _, level in found if level]
    falls = [time for time, _, level in found if not level and time > rises[0]]
    assert len(rises) >= 3
    for rise, fall in zip(rises, falls, strict=False):
        assert abs(fall - rise - 26 * S // HZ) <= US
    assert abs(rises[1] - rises[0] - 100 * S // HZ) <= US


def test_rtc_starts_the_letimer() -> None:
    bench = low(2, "RTC", "LETIMER0")
    bench.load("LETIMER0", CTRL=TOP | mask_of("LETIMER.CTRL.RTCC0TEN"), COMP0=999)
    bench.load("RTC", COMP0=50, CTRL=1)
    bench.run_for(45 * TICK)
    assert not letimer_runs(bench)
    bench.run_for(10 * TICK)
    assert letimer_runs(bench)
