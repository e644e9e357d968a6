"""LESENSE: periods, channel timing, excitation, evaluation, buffer, decoder, sleep."""

from pathlib import Path

import pytest

from tests.emulator.iss.cross_compiler import needs_compiler

from .bench import MS, US, Bench, S, address_of, asleep, compiled, mask_of

LF_HZ, AUX_HZ, CORE_HZ = 32_768, 14_000_000, 14_000_000
CYCLE_PS = S // CORE_HZ + 1
"""Resolution of the times of pins in EM1."""
IRQ, DMA_SOURCE = 17, 50
PERIODIC, ONE_SHOT, BY_PRS = range(3)
DIRECT, INVERSE, TOGGLE, BY_DECODER = range(4)
LEVEL, POSITIVE, NEGATIVE = 1, 2, 3
HIGH, LOW = 1, 2
START, STOP, DECODE, CLEAR = 1, 2, 4, 8
GE, DECODED, STORED, INVERTED = 1 << 16, 1 << 17, 1 << 18, 1 << 19
BY_LEVEL, EXCLK, SAMPLECLK, ALTEX = 1 << 12, 1 << 17, 1 << 18, 1 << 19
MUX, MUX_THRESHOLD = 1, 2
COMPLETE = mask_of("LESENSE.IF.SCANCOMPLETE")
VDD, INPUTS = 9, 10
SUPPLY_V = 3.3
PUSH_PULL = 4


def setif(when: int) -> int:
    return when << 13


def exmode(how: int) -> int:
    return how << 15


def lf_ps(cycles: float) -> int:
    return round(cycles * S / LF_HZ)


def lesense(mode: int = 1, **registers: int) -> Bench:
    """LESENSE on LFRCO; the comparators' inputs against half of the supply (level 32 of 63)."""
    bench = asleep(mode).clock("LE", "ACMP0", "ACMP1", "GPIO", "PRS", "DAC0")
    if mode == 1:
        bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.machine.analog[VDD] = SUPPLY_V
    bench.load("CMU", LFCLKSEL=5, LFACLKEN0=1)
    for unit in ("ACMP0", "ACMP1"):
        bench.load(unit, INPUTSEL=10 << 4 | 32 << 8)
    bench.run_for(2 * MS)
    registers = {"PERCTRL": MUX << 20 | MUX << 22, **registers}
    bench.load("LESENSE", **registers)
    bench.run_for(MS)
    assert not bench["LESENSE.SYNCBUSY"]
    bench.log()
    return bench


def configure(bench: Bench, number: int, **registers: int) -> None:
    for name, value in registers.items():
        bench[f"LESENSE.CH{number}_{name}"] = value


def volts(bench: Bench, channel: int, value: float) -> None:
    bench.machine.analog[INPUTS + channel] = value
    bench.machine.analog_changed()


def scan(bench: Bench, most_ps: int = 10 * MS) -> None:
    """One scan, by command."""
    bench.load("LESENSE", IFC=0x7F_FFFF, CMD=START)
    bench.run_for(most_ps)
    assert bench.is_set("LESENSE.IF.SCANCOMPLETE")


def by_level(channels: int = 0xFFFF, **registers: int) -> Bench:
    """One-shot scans of comparator levels."""
    bench = lesense(CTRL=ONE_SHOT | registers.pop("control", 0), CHEN=channels, **registers)
    for number in range(16):
        configure(bench, number, INTERACT=BY_LEVEL)
    return bench


# -- evaluation --


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


# -- the result buffer --


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


# -- interrupts, sleep --


def test_edge_of_a_sensor_wakes_from_em2() -> None:
    bench = lesense(2, CTRL=PERIODIC, CHEN=0x80, TIMCTRL=31 << 12, IEN=0x80)
    configure(bench, 7, INTERACT=BY_LEVEL | setif(POSITIVE))
    bench["LESENSE.CMD"] = START
    bench.run_for(100 * MS)
    assert bench.machine.energy_mode == 2
    assert bench.pending() == []
    volts(bench, 7, 3.0)
    bench.run_for(MS)
    assert bench.pending() == [IRQ]


def test_nothing_is_scanned_without_the_clock() -> None:
    bench = lesense(CTRL=PERIODIC, CHEN=1, TIMCTRL=9 << 12)
    bench["LESENSE.CMD"] = START
    bench.run_for(10 * MS)
    assert bench["LESENSE.IF"] & COMPLETE
    bench["CMU.LFACLKEN0"] = 0
    bench.run_for(MS)
    bench["LESENSE.IFC"] = COMPLETE
    bench.run_for(10 * MS)
    assert not bench["LESENSE.IF"] & COMPLETE
    bench["CMU.LFACLKEN0"] = 1
    bench.run_for(10 * MS)
    assert bench["LESENSE.IF"] & COMPLETE


BUTTONS = """
/* Counts touches of two sensors in EM2; the core sleeps between them. */
static volatile uint32_t touches[2];

void IRQ(void) {
    uint32_t flags = LESENSE->IF & LESENSE->IEN;
    LESENSE->IFC = flags;
    for (int n = 0; n < 2; n++)
        RESULT[n] = touches[n] += flags >> (4 + n) & 1;
}

int main(void) {
    CMU->OSCENCMD = CMU_OSCENCMD_LFRCOEN;
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_ACMP0;
    CMU->LFACLKEN0 = CMU_LFACLKEN0_LESENSE;
    ACMP0->INPUTSEL = 10 << ACMP_INPUTSEL_NEGSEL_SHIFT;
    LESENSE->CTRL = 0;
    LESENSE->TIMCTRL = 63u << LESENSE_TIMCTRL_PCTOP_SHIFT;
    LESENSE->PERCTRL = 2u << LESENSE_PERCTRL_ACMP0MODE_SHIFT;
    LESENSE->CHEN = 3 << 4;
    LESENSE->CH4_INTERACT = 40 | LESENSE_CH4_INTERACT_SAMPLE |
                            2u << LESENSE_CH4_INTERACT_SETIF_SHIFT;
    LESENSE->CH5_INTERACT = 20 | LESENSE_CH5_INTERACT_SAMPLE |
                            2u << LESENSE_CH5_INTERACT_SETIF_SHIFT;
    LESENSE->IEN = 3 << 4;
    while (LESENSE->SYNCBUSY) ;
    LESENSE->CMD = LESENSE_CMD_START;
    *(volatile uint32_t *)0xE000E100 = 1u << LESENSE_IRQ;
    *(volatile uint32_t *)0xE000ED10 = 4;
    for (;;)
        __asm volatile("wfi");
}
"""


@needs_compiler
def test_compiled_program_counts_touches(tmp_path: Path) -> None:
    bench = Bench(image=compiled(BUTTONS, tmp_path))
    bench.machine.analog[VDD] = SUPPLY_V
    bench.run_for(20 * MS)
    for channel, value in ((4, 1.5), (5, 1.5), (4, 3.0), (5, 0.2), (4, 0.2), (4, 2.5), (5, 3.0)):
        volts(bench, channel, value)  # thresholds: 2.1 V and 1.05 V
        bench.run_for(10 * MS)
        assert bench.machine.energy_mode == 2
    assert [bench.machine.read(0x2001_0000 + 4 * n) for n in range(2)] == [2, 2]
    bench.run_for(100 * US)
