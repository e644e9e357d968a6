"""LESENSE: results of a scan, its period, and the excitation of its pins."""

import pytest

from ..bench import MS, Bench, S, mask_of
from .sensors import (
    ALTEX,
    AUX_HZ,
    BY_DECODER,
    BY_LEVEL,
    BY_PRS,
    COMPLETE,
    CYCLE_PS,
    DIRECT,
    EXCLK,
    GE,
    HIGH,
    INVERSE,
    INVERTED,
    LEVEL,
    LOW,
    MUX,
    MUX_THRESHOLD,
    NEGATIVE,
    ONE_SHOT,
    PERIODIC,
    POSITIVE,
    PUSH_PULL,
    SAMPLECLK,
    START,
    STOP,
    STORED,
    SUPPLY_V,
    TOGGLE,
    by_level,
    configure,
    exmode,
    lesense,
    lf_ps,
    scan,
    setif,
    volts,
)


def test_level_of_each_channel_is_its_result() -> None:
    bench = by_level()
    pattern = 0b1010_0110_1100_0101
    for channel in range(16):
        volts(bench, channel, 3.0 if pattern >> channel & 1 else 0.1)
    scan(bench)
    assert bench["LESENSE.SCANRES"] == pattern
    assert not bench.is_set("LESENSE.STATUS.RUNNING")


def test_only_enabled_channels_are_measured() -> None:
    bench = by_level(0x0101)
    for channel in range(16):
        volts(bench, channel, 3.0)
    scan(bench)
    assert bench["LESENSE.SCANRES"] == 0x0101


@pytest.mark.parametrize("level", [0, 10, 32, 63])
def test_threshold_of_the_channel_goes_to_the_comparator(level: int) -> None:
    bench = by_level(1, PERCTRL=MUX_THRESHOLD << 20)
    bench.run_for(MS)
    configure(bench, 0, INTERACT=BY_LEVEL | level)
    for offset in (-0.01, 0.01):
        volts(bench, 0, SUPPLY_V * level / 63 + offset)
        scan(bench)
        assert bench["LESENSE.SCANRES"] == (offset > 0)


@pytest.mark.parametrize("inverted", [0, INVERTED])
@pytest.mark.parametrize("comparator", [0, mask_of("LESENSE.CTRL.ACMP0INV")])
def test_results_and_comparators_can_be_inverted(comparator: int, inverted: int) -> None:
    bench = by_level(1, control=comparator)
    configure(bench, 0, EVAL=inverted)
    volts(bench, 0, 3.0)
    scan(bench)
    assert bench["LESENSE.SCANRES"] == (not (bool(comparator) ^ bool(inverted)))


@pytest.mark.parametrize(
    ("when", "expected"),
    [(0, [0, 0, 0, 0]), (LEVEL, [1, 1, 0, 1]), (POSITIVE, [1, 0, 0, 1]), (NEGATIVE, [0, 0, 1, 0])],
)
def test_interrupt_comes_at_levels_or_edges(when: int, expected: list[int]) -> None:
    bench = by_level(0x20)
    configure(bench, 5, INTERACT=BY_LEVEL | setif(when))
    found = []
    for value in (3.0, 3.0, 0.0, 3.0):
        volts(bench, 5, value)
        scan(bench)
        found.append(bench["LESENSE.IF"] >> 5 & 1)
    assert found == expected


def test_edges_of_the_comparator_are_counted_in_the_window_only() -> None:
    """Ten periods of delay, then a window of thirty with three rising edges."""
    bench = lesense(CTRL=ONE_SHOT, CHEN=1)
    configure(bench, 0, TIMING=39 << 6 | 10 << 13, EVAL=STORED | GE | 3)
    bench["LESENSE.CMD"] = START
    bench.run_for(lf_ps(3.5))  # the command takes effect
    began = bench.now
    for at in (2, 4, 15, 20, 25, 45, 50):
        bench.run_until(began + lf_ps(at))
        volts(bench, 0, 3.0)
        bench.run_for(lf_ps(1))
        volts(bench, 0, 0.0)
    assert bench["LESENSE.BUFDATA"] == 3
    assert bench["LESENSE.SCANRES"] == 1


@pytest.mark.parametrize(("compare", "result"), [(GE | 0, 1), (GE | 1, 0), (0, 0), (1, 1)])
def test_count_is_compared_with_the_threshold(compare: int, result: int) -> None:
    bench = lesense(CTRL=ONE_SHOT, CHEN=1)
    configure(bench, 0, EVAL=compare)
    scan(bench)
    assert bench["LESENSE.SCANRES"] == result


@pytest.mark.parametrize(
    ("mapping", "expected"), [(DIRECT, 0x0001), (INVERSE, 0x0100), (TOGGLE, 0x0001)]
)
def test_configuration_can_be_that_of_another_channel(mapping: int, expected: int) -> None:
    bench = lesense(CTRL=ONE_SHOT | mapping << 6, CHEN=0x0101)
    configure(bench, 0, EVAL=GE)  # always true
    configure(bench, 8, EVAL=0)  # never
    scan(bench)
    assert bench["LESENSE.SCANRES"] == expected
    scan(bench)
    assert bench["LESENSE.SCANRES"] == (0 if mapping == TOGGLE else expected)


def test_decoder_state_can_select_the_configuration() -> None:
    bench = lesense(CTRL=ONE_SHOT | BY_DECODER << 6, CHEN=1, DECCTRL=1)
    configure(bench, 8, EVAL=GE)
    for state, expected in ((7, 0), (8, 1), (15, 1), (0, 0)):
        bench["LESENSE.DECSTATE"] = state
        bench.run_for(MS)
        scan(bench)
        assert bench["LESENSE.SCANRES"] == expected


# -- times --


@pytest.mark.parametrize(("prescaler", "top"), [(0, 99), (2, 30), (5, 3), (7, 1)])
def test_scans_have_the_period_of_the_formula(prescaler: int, top: int) -> None:
    """Reference Manual, 25.3.2: (1 + PCTOP) * 2^PCPRESC clocks."""
    bench = lesense(CTRL=PERIODIC, CHEN=1, TIMCTRL=prescaler << 8 | top << 12)
    configure(bench, 0, INTERACT=BY_LEVEL, EVAL=STORED)
    span = lf_ps((1 + top) << prescaler)
    bench["LESENSE.CMD"] = START
    bench.run_for(lf_ps(4) + 5 * span + span // 2)
    assert bench["LESENSE.PTR"] >> 5 == 5
    bench.run_for(4 * span)
    assert bench["LESENSE.PTR"] >> 5 == 9
    bench["LESENSE.CMD"] = STOP
    bench.run_for(10 * span + lf_ps(4))
    assert bench["LESENSE.PTR"] >> 5 in (9, 10)
    assert not bench.is_set("LESENSE.STATUS.RUNNING")


@pytest.mark.parametrize("prescaler", [0, 3])
def test_cmu_prescaler_slows_the_scans(prescaler: int) -> None:
    bench = lesense(CTRL=PERIODIC, CHEN=1, TIMCTRL=9 << 12)
    configure(bench, 0, INTERACT=BY_LEVEL, EVAL=STORED)
    bench["CMU.LFAPRESC0"] = prescaler
    bench.run_for(MS)
    bench["LESENSE.CMD"] = START
    bench.run_for(lf_ps(105 << prescaler))
    assert bench["LESENSE.PTR"] >> 5 == 10


def excited(bench: Bench, pin: int) -> tuple[int, int]:
    """Start and length of the only excitation of a pin, in picoseconds."""
    rise, fall = bench.pins(pin)
    assert (rise[2], fall[2]) == (1, 0)
    return rise[0], fall[0] - rise[0]


@pytest.mark.parametrize("prescaler", [0, 2, 7])
@pytest.mark.parametrize("cycles", [1, 5, 64])
def test_pin_is_excited_for_its_time_on_the_low_frequency_clock(
    cycles: int, prescaler: int
) -> None:
    bench = lesense(
        CTRL=ONE_SHOT, CHEN=8, ROUTE=8, IDLECONF=LOW << 6, TIMCTRL=prescaler << 4 | 3 << 22
    )
    bench["GPIO.PC_MODEL"] = PUSH_PULL << 12
    configure(bench, 3, TIMING=cycles - 1, INTERACT=BY_LEVEL | exmode(HIGH))
    bench.pins()
    bench["LESENSE.CMD"] = START
    began = bench.now
    bench.run_for(S)
    start, length = excited(bench, 2 * 16 + 3)
    assert lf_ps(2 + 3) < start - began <= lf_ps(3 + 3)  # synchronisation, then the start delay
    assert abs(length - lf_ps(cycles << prescaler)) <= CYCLE_PS


def test_pin_is_excited_for_its_time_on_the_high_frequency_clock() -> None:
    bench = lesense(CTRL=ONE_SHOT, CHEN=1, ROUTE=1, IDLECONF=LOW, TIMCTRL=2)
    bench["GPIO.PC_MODEL"] = PUSH_PULL
    configure(bench, 0, TIMING=20, INTERACT=BY_LEVEL | EXCLK | SAMPLECLK | exmode(HIGH))
    bench.pins()
    scan(bench)
    assert abs(excited(bench, 2 * 16)[1] - 21 * 4 * S // AUX_HZ) <= CYCLE_PS


@pytest.mark.parametrize(
    ("channel", "at_comparators", "pin"), [(0, 0, 3 * 16 + 6), (13, 0, 4 * 16 + 11), (2, 1, 42)]
)
def test_alternative_pin_is_excited(channel: int, at_comparators: int, pin: int) -> None:
    bench = lesense(
        CTRL=ONE_SHOT | at_comparators << 11,
        CHEN=1 << channel,
        ROUTE=0xFF_FFFF,
        IDLECONF=0xAAAA_AAAA,
        ALTEXCONF=0xAAAA,
    )
    port, bit = divmod(pin, 16)
    bench[f"GPIO.P{'ABCDEF'[port]}_MODE{'LH'[bit // 8]}"] = PUSH_PULL << bit % 8 * 4
    configure(bench, channel, TIMING=3, INTERACT=BY_LEVEL | ALTEX | exmode(HIGH))
    bench.pins()
    scan(bench)
    assert abs(excited(bench, pin)[1] - lf_ps(4)) <= CYCLE_PS
    assert bench.pins() == []


def test_pin_without_route_stays_with_the_port() -> None:
    bench = lesense(CTRL=ONE_SHOT, CHEN=1, ROUTE=0, IDLECONF=HIGH)
    bench["GPIO.PC_MODEL"] = PUSH_PULL
    configure(bench, 0, INTERACT=BY_LEVEL | exmode(HIGH))
    bench.pins()
    scan(bench)
    assert bench.pins() == []


def test_reflex_signal_starts_a_scan() -> None:
    bench = lesense(CTRL=BY_PRS | 7 << 2, CHEN=1)
    configure(bench, 0, EVAL=GE)
    bench["LESENSE.CMD"] = START
    bench.run_for(MS)
    assert not bench["LESENSE.IF"] & COMPLETE
    bench["PRS.SWPULSE"] = 1 << 7
    bench.run_for(MS)
    assert bench["LESENSE.IF"] & COMPLETE
    assert bench["LESENSE.SCANRES"] == 1


def test_dac_gives_the_threshold_of_the_channel() -> None:
    """The DAC's pin and the comparator's negative input have ACMPTHRES while the scan lasts."""
    bench = by_level(1, PERCTRL=MUX << 20 | 1 | 2 << 2 | 3 << 6)
    bench["ACMP0.INPUTSEL"] = 12 << 4
    bench["DAC0.CTRL"] = 2 << 8
    configure(bench, 0, INTERACT=BY_LEVEL | 2000, TIMING=63 << 6 | 63)
    bench.run_for(MS)
    threshold = SUPPLY_V * 2000 / 4095
    for value in (threshold - 0.01, threshold + 0.01):
        volts(bench, 0, value)
        bench["LESENSE.CMD"] = START
        bench.run_for(MS)
        assert bench.machine.pin_millivolts(1, 11) == pytest.approx(1000 * threshold)
        bench.run_for(5 * MS)
        assert bench.machine.pin_millivolts(1, 11) is None
        assert bench["LESENSE.SCANRES"] == (value > threshold)
