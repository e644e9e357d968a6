"""TIMER against a counter that steps each tick; outputs, captures, cascades, interrupts."""

from dataclasses import dataclass

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .bench import Bench, S, asleep, mask_of

HZ = 14_000_000
TICK = S // HZ + 1
ACCESS = 8 * TICK  # longest time of a few accesses
UP, DOWN, UP_DOWN = 0, 1, 2
OF, UF, CC0, CC1, CC2 = 1, 2, 16, 32, 64
PWM, COMPARE, CAPTURE = 3, 2, 1
PUSH_PULL, INPUT = 4, 1
TIMER0_IRQ = 2


def timer(mode: int = UP, prescaler: int = 0, top: int = 0xFFFF, more: int = 0) -> Bench:
    bench = asleep(1, interrupts=False).clock("TIMER0", "TIMER1", "GPIO")
    bench.load("TIMER0", CTRL=mode | prescaler << 24 | more, TOP=top)
    return bench


def start(bench: Bench) -> int:
    """Start; returns about the time of tick 0, as an access takes a few cycles."""
    bench["TIMER0.CMD"] = 1
    return bench.now


def ticks(bench: Bench, count: int, prescaler: int = 0) -> None:
    bench.run_for((count << prescaler) * S // HZ)


@dataclass
class Oracle:
    """A counter that steps each tick, as the manual describes it."""

    mode: int
    top: int
    compare: int
    value: int = 0
    down: bool = False
    flags: int = 0

    def tick(self) -> None:
        if self.value == self.compare:
            self.flags |= CC0
        if self.mode == UP:
            if self.value == self.top:
                self.value, self.flags = 0, self.flags | OF
            else:
                self.value = (self.value + 1) & 0xFFFF
        elif self.mode == DOWN:
            if self.value == 0:
                self.value, self.flags = self.top, self.flags | UF
            else:
                self.value -= 1
        elif self.down:
            if self.value == 0:
                self.value, self.down, self.flags = 1, False, self.flags | UF
            else:
                self.value -= 1
        elif self.value == self.top:
            self.value, self.down, self.flags = self.top - 1, True, self.flags | OF
        else:
            self.value += 1


@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from([UP, DOWN, UP_DOWN]),
    st.integers(5, 7),
    st.integers(2, 300),
    st.integers(0, 310),
    st.lists(st.integers(0, 700), min_size=1, max_size=6),
    st.booleans(),
)
def test_counts_like_a_stepped_counter(
    mode: int, prescaler: int, top: int, compare: int, waits: list[int], watched: bool
) -> None:
    bench = timer(mode, prescaler, top)
    bench.load("TIMER0", CC0_CTRL=COMPARE, CC0_CCV=compare, IEN=OF | UF | CC0 if watched else 0)
    oracle = Oracle(mode, top, compare, down=mode == DOWN)
    origin = start(bench)
    count = 0
    for wait in waits:
        count += wait
        # Half a tick after the edge, so that rounding does not matter.
        bench.run_until(origin + (2 * count + 1) * (1 << prescaler) * S // (2 * HZ))
        for _ in range(wait):
            oracle.tick()
        assert (bench["TIMER0.CNT"], bench["TIMER0.IF"]) == (oracle.value, oracle.flags)
        if mode == UP_DOWN:
            assert bench.is_set("TIMER0.STATUS.DIR") == oracle.down


@pytest.mark.parametrize("prescaler", range(11))
def test_timer_counts_with_its_prescaler(prescaler: int) -> None:
    bench = timer(prescaler=prescaler)
    origin = start(bench)
    bench.run_until(origin + (100 * (1 << prescaler)) * S // HZ)
    assert abs(bench["TIMER0.CNT"] - 100) <= 3


def test_overflow_interrupts_at_its_time() -> None:
    bench = timer(top=999)
    bench["TIMER0.IEN"] = OF
    origin = start(bench)
    bench.run_until(origin + 1000 * S // HZ - ACCESS)
    assert not bench.peek("TIMER0.IF")
    bench.run_until(origin + 1000 * S // HZ + ACCESS)
    assert (bench.peek("TIMER0.IF"), bench.pending()) == (OF, [TIMER0_IRQ])
    bench["TIMER0.IFC"] = OF
    assert bench["TIMER0.IF"] == 0


def test_one_shot_stops_at_the_overflow() -> None:
    bench = timer(top=99, more=mask_of("TIMER.CTRL.OSMEN"))
    start(bench)
    ticks(bench, 1000)
    assert not bench.is_set("TIMER0.STATUS.RUNNING")
    assert bench["TIMER0.CNT"] == 0


def test_timer_stops_and_continues() -> None:
    bench = timer()
    start(bench)
    ticks(bench, 100)
    bench["TIMER0.CMD"] = 2
    value = bench["TIMER0.CNT"]
    assert abs(value - 100) <= 1
    ticks(bench, 100)
    assert bench["TIMER0.CNT"] == value
    bench["TIMER0.CMD"] = 1
    ticks(bench, 50)
    assert abs(bench["TIMER0.CNT"] - value - 50) <= 1


def test_buffered_top_and_compare_are_loaded_at_the_overflow() -> None:
    bench = timer(top=99)
    bench.load("TIMER0", CC0_CTRL=PWM, CC0_CCV=10)
    start(bench)
    ticks(bench, 50)
    bench.load("TIMER0", TOPB=199, CC0_CCVB=20)
    assert bench.is_set("TIMER0.STATUS.TOPBV")
    assert bench.is_set("TIMER0.STATUS.CCVBV0")
    assert (bench["TIMER0.TOP"], bench["TIMER0.CC0_CCV"]) == (99, 10)
    ticks(bench, 60)
    assert (bench["TIMER0.TOP"], bench["TIMER0.CC0_CCV"]) == (199, 20)
    assert not bench.is_set("TIMER0.STATUS.TOPBV")


def captures(more: int = 0, edge: int = 0) -> Bench:
    """TIMER0 with channel 0 capturing edges at PA0."""
    bench = timer(more=more).load("GPIO", PA_MODEL=INPUT)
    return bench.load("TIMER0", ROUTE=1, CC0_CTRL=CAPTURE | edge << 24)


def test_pwm_drives_its_pin() -> None:
    bench = timer(prescaler=2, top=99)
    bench["GPIO.PA_MODEL"] = PUSH_PULL << 4
    bench.load("TIMER0", CC1_CTRL=PWM, CC1_CCV=25, ROUTE=2)
    origin = start(bench)
    ticks(bench, 250, 2)
    found = [(time, level) for time, _, level in bench.pins(1)]
    assert [level for _, level in found] == [0, 1, 0, 1, 0, 1, 0]
    for (time, _), tick in zip(found[2:], (25, 100, 125, 200, 225), strict=True):
        assert abs(time - origin - tick * 4 * S // HZ) <= ACCESS


def test_compare_match_toggles_the_pin() -> None:
    bench = timer(top=9)
    bench["GPIO.PA_MODEL"] = PUSH_PULL
    bench["TIMER0.CC0_CTRL"] = COMPARE | 1 << 8  # toggles at a match
    bench.load("TIMER0", CC0_CCV=3, ROUTE=1)
    origin = start(bench)
    ticks(bench, 35)
    times = [time for time, _, _ in bench.pins(0) if time > origin]
    assert [round((time - times[0]) * HZ / S) for time in times] == [0, 10, 20, 30]


def test_cascaded_timer_counts_overflows() -> None:
    bench = timer(top=9)
    bench.load("TIMER1", CTRL=2 << 16, CMD=1)
    start(bench)
    ticks(bench, 257)
    assert bench["TIMER1.CNT"] in (25, 26)


def test_synchronised_timers_start_together() -> None:
    bench = timer(more=mask_of("TIMER.CTRL.SYNC"))
    bench["TIMER1.CTRL"] = mask_of("TIMER.CTRL.SYNC")
    start(bench)
    ticks(bench, 77)
    assert abs(bench["TIMER1.CNT"] - bench["TIMER0.CNT"]) <= 3


def test_capture_has_the_count_at_the_edge() -> None:
    bench = captures()
    origin = start(bench)
    for tick, level in ((100, 1), (150, 0), (300, 1)):
        bench.run_until(origin + tick * S // HZ + TICK // 2)
        bench.machine.pin(0, 0, level)
    assert bench["TIMER0.IF"] & CC0
    assert bench.is_set("TIMER0.STATUS.ICV0")
    first, second = bench["TIMER0.CC0_CCV"], bench["TIMER0.CC0_CCV"]
    assert abs(first - 100) <= 3
    assert second - first == 200
    assert not bench.is_set("TIMER0.STATUS.ICV0")


def test_third_unread_capture_sets_overflow() -> None:
    bench = captures(edge=2)
    start(bench)
    for level in (1, 0, 1):
        ticks(bench, 10)
        bench.machine.pin(0, 0, level)
    assert bench.is_set("TIMER0.IF.ICBOF0")


def test_edges_start_and_stop_the_timer() -> None:
    bench = captures(more=1 << 8 | 2 << 10)  # rising starts, falling stops
    ticks(bench, 50)
    assert bench["TIMER0.CNT"] == 0
    bench.machine.pin(0, 0, 1)
    ticks(bench, 60)
    bench.machine.pin(0, 0, 0)
    ticks(bench, 60)
    assert abs(bench["TIMER0.CNT"] - 60) <= 1


def test_timer_counts_at_its_divided_and_gated_clock() -> None:
    bench = timer()
    start(bench)
    ticks(bench, 1000)
    bench["CMU.HFPERCLKDIV"] = 0x100 | 1
    before = bench["TIMER0.CNT"]
    ticks(bench, 1000)
    assert abs(bench["TIMER0.CNT"] - before - 500) <= 8
    bench["CMU.HFPERCLKEN0"] = 0
    bench.clock("GPIO")
    ticks(bench, 1000)
    bench.clock("TIMER0")
    assert abs(bench["TIMER0.CNT"] - before - 500) <= 8


def test_long_time_without_effects_is_skipped() -> None:
    bench = timer(top=3)
    start(bench)
    bench.run_for(S // 100)
    assert bench["TIMER0.CNT"] <= 3
    assert bench["TIMER0.IF"] & OF
