"""PCNT: pulses, clocks, and what synchronises them."""

import pytest

from ..bench import Bench
from .domain import INPUT, TICK, low

LFACLK, FROM_PIN = 1, 3
"""Of PCNT0, in CMU_PCNTCTRL."""


def pulses(bench: Bench, number: int) -> None:
    for _ in range(number):
        bench.machine.pin(2, 13, 1)
        bench.machine.pin(2, 13, 0)


def pulse_counter(clock: int, mode: int = 1, **registers: int) -> Bench:
    """Pulse counter 0 in this energy mode, with that clock."""
    bench = low(mode)
    bench["GPIO.PC_MODEH"] = INPUT << 20
    bench["CMU.PCNTCTRL"] = clock
    bench.load("PCNT0", **registers)
    bench.run_for(4 * TICK)
    return bench


def after_edges(number: int, **registers: int) -> Bench:
    """Pulse counter 0 after that many pulses at its pin, set up on LFACLK as a driver does."""
    bench = pulse_counter(LFACLK, **registers)
    if registers["CTRL"] & 3 == 2:
        bench["CMU.PCNTCTRL"] = FROM_PIN
    pulses(bench, number)
    return bench


@pytest.mark.parametrize(("control", "counted"), [(1, 5), (2, 5), (0, 0), (1 | 8, 5)])
def test_pulse_counter_counts_edges(control: int, counted: int) -> None:
    assert after_edges(5, CTRL=control)["PCNT0.CNT"] == counted


def test_pulse_counter_overflows_at_its_top() -> None:
    bench = after_edges(4, TOPB=2, CTRL=1)
    assert bench["PCNT0.CNT"] == 1
    assert bench["PCNT0.IF"] & 2


def test_without_its_clock_the_pulse_counter_waits_and_counts_nothing() -> None:
    bench = pulse_counter(0, CTRL=1)
    assert bench["PCNT0.SYNCBUSY"]
    pulses(bench, 5)
    assert bench["PCNT0.CNT"] == 0
    bench["CMU.PCNTCTRL"] = LFACLK
    bench.run_for(4 * TICK)
    pulses(bench, 5)
    assert (bench["PCNT0.SYNCBUSY"], bench["PCNT0.CNT"]) == (0, 5)
    assert bench.log() == ""


def test_pulses_at_the_clock_input_synchronize_writes_before_they_count() -> None:
    bench = pulse_counter(FROM_PIN, CTRL=2)
    pulses(bench, 2)
    assert bench["PCNT0.SYNCBUSY"]
    pulses(bench, 1)
    assert (bench["PCNT0.SYNCBUSY"], bench["PCNT0.CNT"]) == (0, 0)
    pulses(bench, 4)
    assert bench["PCNT0.CNT"] == 4


@pytest.mark.parametrize(("control", "clock", "counted"), [(1, LFACLK, 0), (2, FROM_PIN, 5)])
def test_in_em3_only_its_input_clocks_the_pulse_counter(
    control: int, clock: int, counted: int
) -> None:
    bench = pulse_counter(LFACLK, 3, CTRL=control)
    bench["CMU.PCNTCTRL"] = clock
    pulses(bench, 3 if counted else 0)  # the writes that EM3 left waiting
    pulses(bench, 5)
    assert bench["PCNT0.CNT"] == counted


def test_pulse_counter_reports_a_mode_that_its_clock_does_not_fit() -> None:
    bench = pulse_counter(LFACLK, CTRL=2)
    pulses(bench, 5)
    assert bench["PCNT0.CNT"] == 0
    assert bench.log() == "PCNT0: CTRL.MODE 2 needs the other clock of CMU.PCNTCTRL"
