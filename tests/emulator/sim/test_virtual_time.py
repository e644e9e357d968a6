"""Virtual time is exact: no cycle is lost in a rounding, no event is passed over."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.sim.virtual_time import PS_PER_S, CycleClock, Kernel

HZ = st.integers(1, 10**10)
CYCLES = st.lists(st.integers(0, 10**9), max_size=20)


@given(HZ, CYCLES)
def test_split_cycle_counts_elapse_like_their_sum(hz, pieces):
    split, whole = CycleClock(hz), CycleClock(hz)
    assert sum(split.elapse(cycles) for cycles in pieces) == whole.elapse(sum(pieces))


@given(HZ, CYCLES)
def test_cycle_clock_lags_true_time_by_less_than_1_ps(hz, pieces):
    clock, elapsed, cycles = CycleClock(hz), 0, 0
    for piece in pieces:
        elapsed += clock.elapse(piece)
        cycles += piece
        assert 0 <= Fraction(cycles * PS_PER_S, hz) - elapsed < 1


def test_cycle_clock_carries_the_remainder():
    clock = CycleClock(3)
    third = PS_PER_S // 3
    assert [clock.elapse(1) for _ in range(3)] == [third, third, third + 1]


@pytest.mark.parametrize("hz", [0, -48_000_000])
def test_frequency_must_be_positive(hz):
    with pytest.raises(ValueError, match=f"positive frequency, not {hz} Hz"):
        CycleClock(hz)


def test_horizon_is_the_next_event():
    kernel = Kernel()
    assert kernel.horizon() is None
    assert kernel.held_ns == 0  # nobody held it
    kernel.timeout(7)
    kernel.timeout(5)
    assert kernel.horizon() == 5
    kernel.step()
    assert kernel.horizon() == 7


def test_kernel_time_is_an_exact_integer():
    kernel = Kernel()
    kernel.advance_to(10**18 + 1)  # a float would lose the one
    assert kernel.now == 10**18 + 1
    assert type(kernel.now) is int


def test_advance_processes_events_before_its_target_time():
    kernel = Kernel()
    happened = []
    for time in (10, 20, 30):
        kernel.timeout(time).callbacks.append(lambda _event: happened.append(kernel.now))
    kernel.advance_to(20)  # an event at that very instant comes after whoever waited for it
    assert (happened, kernel.now) == ([10], 20)
    kernel.advance_to(25)
    assert (happened, kernel.now) == ([10, 20], 25)
    kernel.advance_to(40)
    assert kernel.horizon() is None  # nothing is left behind
    kernel.timeout(7)
    kernel.advance_to(45)
    assert kernel.horizon() == 47


def test_horizon_is_no_later_than_the_target_time():
    """Look-ahead stops there, because an outside event may follow."""
    kernel = Kernel()
    seen = []
    kernel.timeout(10).callbacks.append(lambda _event: seen.append(kernel.horizon()))
    kernel.timeout(50)
    kernel.advance_to(20)
    assert seen == [20]


@pytest.mark.parametrize("time", [0, 19, 20])
def test_advance_never_goes_back(time):
    kernel = Kernel()
    kernel.advance_to(20)
    kernel.advance_to(time)
    assert kernel.now == 20
