import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.cubesense.timer import microseconds, read_ticks, ticks_of, ticks_since
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine


def answered(routine: Routine[int], now_us: int) -> int:
    assert next(routine) == ReadTimer()
    with pytest.raises(StopIteration) as end:
        routine.send(now_us)
    value: int = end.value.value
    return value


@given(st.integers(0, 10**12), st.integers(0, 3_350_000))
def test_a_duration_is_right_to_a_tick_across_the_timers_overflow(start: int, us: int) -> None:
    started = answered(read_ticks(), start)
    assert 0 <= started < 65536
    measured = microseconds(answered(ticks_since(started), start + us))
    assert abs(measured - us) <= 52
    assert -measured * 5 % 256 < 5  # whole ticks, rounded down to 1 us


def test_a_tick_is_51_2_us() -> None:
    assert microseconds(1000) == 51_200
    assert ticks_of(51_200) == 1000
    assert ticks_of(51_199) == 999
