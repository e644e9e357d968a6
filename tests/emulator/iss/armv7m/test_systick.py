"""SysTick against a counter that is stepped cycle by cycle (B3.3)."""

from dataclasses import dataclass, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .bench import SYSTEM, Bench

CSR, RVR, CVR, CALIB = (SYSTEM["SYSTICK"] + 4 * n for n in range(4))
REFERENCE = (7, 2)  # 7 core cycles are 2 of its ticks


@dataclass
class Counter:
    """The counter as the manual describes it."""

    control: int = 0
    reload: int = 0
    value: int = 0
    flag: bool = False
    pending: bool = False

    def tick(self) -> None:
        if not self.control & 1:
            return
        if self.value == 0:
            self.value = self.reload
            return
        self.value -= 1
        if self.value == 0:
            self.flag = True
            self.pending |= bool(self.control & 2)

    def cycle(self, now: int) -> None:
        """Pass one core cycle, the one that begins at ``now``."""
        cycles, ticks = REFERENCE
        by_core = self.control & 4
        if by_core or (now + 1) * ticks // cycles > now * ticks // cycles:
            self.tick()

    def csr(self) -> int:
        value = self.control | self.flag << 16
        self.flag = False
        return value


ACTIONS = st.one_of(
    st.tuples(st.just("wait"), st.integers(0, 40)),
    st.tuples(st.sampled_from(["csr", "rvr", "cvr"]), st.none()),
    st.tuples(st.just("write csr"), st.integers(0, 7)),
    st.tuples(st.just("write rvr"), st.integers(0, 9)),
    st.tuples(st.just("write cvr"), st.integers(0, 3)),
    st.tuples(st.just("clear"), st.none()),
)


@settings(max_examples=100, deadline=None)
@given(st.lists(ACTIONS, max_size=60))
def test_counts_like_a_stepped_counter(actions):
    bench = Bench(reference=REFERENCE)
    bench["primask"] = 1  # pending, but not taken
    counter = Counter()
    for action, argument in actions:
        if action == "wait":
            for cycle in range(bench.cycles, bench.cycles + argument):
                counter.cycle(cycle)
            bench.cycles += argument
            bench.service()
        elif action == "csr":
            assert bench.peek(CSR) == bench.peek(CSR)
            assert bench.read(CSR) == counter.csr()
        elif action == "rvr":
            assert bench.read(RVR) == counter.reload
        elif action == "cvr":
            assert bench.read(CVR) == counter.value
        elif action == "write csr":
            bench.write(CSR, argument)
            counter.control = argument
        elif action == "write rvr":
            bench.write(RVR, argument)
            counter.reload = argument
        elif action == "write cvr":
            bench.write(CVR, argument)
            counter.value, counter.flag = 0, False
        else:
            bench["ICSR"] = 1 << 25
            counter.pending = False
        assert bool(bench["ICSR"] >> 26 & 1) == counter.pending
        ahead = replace(counter, pending=False)
        for cycle in range(bench.cycles, bench.cycles + 80):
            ahead.cycle(cycle)
            if ahead.pending:
                assert bench.next_cycle == cycle + 1
                break
        else:
            assert bench.next_cycle > bench.cycles + 80


def test_long_periods_wrap_at_their_cycle():
    bench = Bench()
    bench.write(RVR, 0xFFFFFF)
    bench.write(CVR, 0)
    bench.write(CSR, 7)
    start = bench.cycles
    assert bench.next_cycle == start + (1 << 24)
    bench.cycles = start + (1 << 24) - 1
    bench.service()
    assert (bench.ipsr, bench.read(CVR)) == (0, 1)
    bench.cycles += 1
    bench.service()
    assert bench.ipsr == 15
    bench.cycles = start + 5 * (1 << 24) + 3  # several wraps at once
    assert bench.read(CSR) == 7 | 1 << 16
    assert bench.read(CVR) == (1 << 24) - 3


@pytest.mark.parametrize(("reference", "source"), [((0, 1), 4), (REFERENCE, 0)])
def test_clksource_reads_one_without_reference_clock(reference, source):
    bench = Bench(reference=reference)
    bench.write(CSR, 0)
    assert (bench.read(CSR), bench.read(CALIB)) == (source, 0xC000_0000)
