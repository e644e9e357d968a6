"""LESENSE: the result buffer, and the decoder that follows sensors."""

import pytest

from ..bench import MS, Bench, address_of, mask_of
from .sensors import (
    BY_LEVEL,
    CLEAR,
    DECODE,
    DECODED,
    DMA_SOURCE,
    GE,
    ONE_SHOT,
    PERIODIC,
    START,
    STORED,
    by_level,
    configure,
    lesense,
    lf_ps,
    scan,
    volts,
)


def stored(count: int, control: int = 0) -> Bench:
    """After ``count`` scans; their results are the comparator's level: 0, 1, 0 ..."""
    bench = lesense(CTRL=ONE_SHOT | control, CHEN=1)
    configure(bench, 0, INTERACT=BY_LEVEL, EVAL=STORED)
    for n in range(count):
        volts(bench, 0, 3.0 * (n % 2))
        scan(bench, MS)
    return bench


@pytest.mark.parametrize("count", [0, 1, 7, 8, 15, 16])
def test_buffer_reports_its_level(count: int) -> None:
    bench = stored(count)
    assert bench.is_set("LESENSE.STATUS.BUFDATAV") == (count > 0)
    assert bench.is_set("LESENSE.STATUS.BUFHALFFULL") == (count >= 8)
    assert bench.is_set("LESENSE.STATUS.BUFFULL") == (count == 16)
    assert [bench["LESENSE.BUFDATA"] for _ in range(count)] == [n % 2 for n in range(count)]
    assert not bench.is_set("LESENSE.STATUS.BUFDATAV")


@pytest.mark.parametrize("overwrite", [0, mask_of("LESENSE.CTRL.BUFOW")])
def test_full_buffer_loses_the_newest_or_the_oldest_entry(overwrite: int) -> None:
    bench = stored(17, overwrite)
    assert bench.is_set("LESENSE.IF.BUFOF")
    assert [bench["LESENSE.BUFDATA"] for _ in range(16)] == [
        (n + bool(overwrite)) % 2 for n in range(16)
    ]


def test_scan_results_can_be_stored_and_the_buffer_cleared() -> None:
    bench = by_level(0xFF, control=mask_of("LESENSE.CTRL.STRSCANRES"))
    for channel in (1, 6):
        volts(bench, channel, 3.0)
    scan(bench)
    assert bench["LESENSE.BUFDATA"] == 0x42
    scan(bench)
    bench["LESENSE.CMD"] = CLEAR
    bench.run_for(MS)
    assert not bench.is_set("LESENSE.STATUS.BUFDATAV")


@pytest.mark.parametrize("mode", [1, 2])
def test_dma_empties_the_buffer_at_its_level(mode: int) -> None:
    bench = lesense(mode, CTRL=PERIODIC | 1 << 20, CHEN=1, TIMCTRL=9 << 12)
    configure(bench, 0, EVAL=STORED | GE)
    halfwords = 1 << 30 | 1 << 28 | 3 << 26 | 1 << 24 | 3 << 14 | 7 << 4 | 1
    bench.machine.poke(0x2000_1000, bytes([0xFF] * 16))
    bench.dma(0, DMA_SOURCE << 16, address_of("LESENSE.BUFDATA"), 0x2000_100E, halfwords)
    bench["LESENSE.CMD"] = START
    bench.run_for(lf_ps(4 + 75))
    assert bench.machine.peek(0x2000_1000, 2) == b"\xff\xff"
    bench.run_for(lf_ps(10))
    assert bench.machine.peek(0x2000_1000, 16) == bytes(16)


# -- the decoder --


def transition(compare: int, following: int, more: int = 0, ignore: int = 0) -> int:
    return compare | ignore << 4 | following << 8 | more


def act(action: int) -> int:
    return action << 12


TRANSITION_FLAG, CHAIN = 1 << 16, 1 << 18
UP, DOWN = 1, 2


def decoder(control: int = 0, **states: int) -> Bench:
    bench = by_level(3, DECCTRL=control, DECSTATE=0)
    for name, value in states.items():
        bench[f"LESENSE.{name}"] = value
    for number in (0, 1):
        configure(bench, number, EVAL=DECODED)
    return bench


def sense(bench: Bench, sensors: int) -> int:
    for channel in (0, 1):
        volts(bench, channel, 3.0 * (sensors >> channel & 1))
    scan(bench)
    assert bench["LESENSE.SENSORSTATE"] == sensors
    return bench["LESENSE.DECSTATE"]


def quadrature(control: int) -> Bench:
    """States 0, 1, 3, 2 of two sensors a quarter apart; forward counts up."""
    ring = (0, 1, 3, 2)
    states = {}
    for n, state in enumerate(ring):
        after, before = ring[(n + 1) % 4], ring[n - 1]
        states[f"ST{state}_TCONFA"] = transition(after, after, act(UP) | TRANSITION_FLAG)
        states[f"ST{state}_TCONFB"] = transition(before, before, act(DOWN) | TRANSITION_FLAG)
    return decoder(control, **states)


def test_decoder_follows_two_sensors_and_counts_by_reflex() -> None:
    bench = quadrature(mask_of("LESENSE.DECCTRL.PRSCNT"))
    # PCNT0 counts pulses of decoder channel 0; the direction is channel 1.
    bench.load("PRS", CH0_CTRL=59 << 16, CH1_CTRL=59 << 16 | 1)
    bench.load("CMU", PCNTCTRL=1)
    bench.load("PCNT0", TOPB=0xFF, INPUT=1 << 4 | 1 << 10 | 1 << 6, CTRL=1 | 1 << 9)
    bench.run_for(MS)
    path = ((1, 1), (3, 2), (2, 3), (0, 4), (1, 5), (0, 4), (2, 3), (2, 3))
    for sensors, position in path:
        assert sense(bench, sensors) == sensors
        assert bench["PCNT0.CNT"] == position
    assert not bench.is_set("LESENSE.IF.DEC")


def test_unknown_sensors_are_an_error_if_checked() -> None:
    for checks in (0, mask_of("LESENSE.DECCTRL.ERRCHK")):
        bench = quadrature(checks)
        assert sense(bench, 1) == 1
        assert sense(bench, 1) == 1
        assert not bench.is_set("LESENSE.IF.DECERR")
        assert sense(bench, 2) == 1  # two steps at once
        assert bench.is_set("LESENSE.IF.DECERR") == bool(checks)


def test_states_can_be_chained_and_sensors_ignored() -> None:
    bench = decoder(
        ST0_TCONFA=transition(1, 5, CHAIN), ST0_TCONFB=transition(2, 6),
        ST1_TCONFA=transition(0, 9, ignore=0xF), ST1_TCONFB=transition(0, 10),
        ST9_TCONFA=transition(2, 11, ignore=0xD), ST9_TCONFB=transition(15, 0),
    )  # fmt: skip
    assert sense(bench, 3) == 9  # by the chained state, whose mask ignores all sensors
    assert sense(bench, 1) == 9
    assert sense(bench, 2) == 11


def test_hysteresis_suppresses_the_step_back() -> None:
    bench = quadrature(mask_of("LESENSE.DECCTRL.HYSTIRQ"))
    for sensors, flagged in ((1, True), (3, True), (1, False), (0, True), (2, True), (0, False)):
        sense(bench, sensors)
        assert bench.is_set("LESENSE.IF.DEC") == flagged, sensors


def test_state_can_select_the_interrupt() -> None:
    bench = quadrature(mask_of("LESENSE.DECCTRL.INTMAP"))
    for sensors, left in ((1, 0), (3, 1), (2, 3)):
        sense(bench, sensors)
        assert bench["LESENSE.IF"] & 0xFFFF == 1 << left


def test_decoder_can_take_reflex_signals_by_command() -> None:
    bench = decoder(mask_of("LESENSE.DECCTRL.INPUT") | 4 << 10 | 5 << 14 | 6 << 18 | 6 << 22,
                    ST0_TCONFA=transition(2, 3), ST0_TCONFB=transition(15, 0))  # fmt: skip
    bench["PRS.SWLEVEL"] = 1 << 5
    bench["LESENSE.CMD"] = DECODE
    bench.run_for(MS)
    assert bench["LESENSE.DECSTATE"] == 3
