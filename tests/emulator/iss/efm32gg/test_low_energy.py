"""Units that work in EM2: LEUART, RTC, LETIMER, BURTC with its retention registers, PCNT."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.iss.outcome import OutgoingKind

from .bench import MS, POWER_ON, SYSTEM_REQUEST, US, WATCHDOG, Bench, S, asleep, mask_of

HZ = 32768
TICK = S // HZ + 1
PUSH_PULL, INPUT = 4, 1
PD4, PD5, PD6 = (3 * 16 + n for n in (4, 5, 6))
LEUART0 = 5
LETIMER_IRQ, BURTC_IRQ = 26, 31
NOT_PENDING = 0xE000_E280


def low(mode: int = 2, *units: str, interrupts: bool = False) -> Bench:
    """A sleeping part with LFRCO and the clocks of low-energy units."""
    bench = asleep(mode, interrupts).clock("LE", "GPIO")
    if mode != 2:
        bench.command("CMU.OSCENCMD.LFRCOEN")
        bench.run_for(200 * US)
    for unit in units:
        bench.set(f"CMU.LF{'B' if unit.startswith('LEUART') else 'A'}CLKEN0.{unit}")
    bench.run_for(4 * TICK)
    return bench


# -- RTC --


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


# -- LEUART --


def leuart(clkdiv: int = 617, control: int = 0, *, interrupts: bool = False) -> Bench:
    bench = low(2, "LEUART0", interrupts=interrupts)
    bench["GPIO.PD_MODEL"] = PUSH_PULL << 16 | INPUT << 20
    bench.load("LEUART0", ROUTE=3, CTRL=control, CLKDIV=clkdiv & 0x7FF8, CMD=5)
    bench.run_for(4 * TICK)
    return bench


def test_leuart_sends_at_9600_baud_in_em2() -> None:
    bench = leuart()
    for byte in b"go":
        bench["LEUART0.TXDATA"] = byte
        while bench["LEUART0.SYNCBUSY"]:
            bench.run_for(TICK)
    bench.run_for(3 * MS)
    items = bench.out(OutgoingKind.UART)
    assert [item.value for item in items] == list(b"go")
    assert items[0].unit == LEUART0 | PD4 << 8
    expected = 10 * (256 + 616) * S // 256 // HZ
    assert abs(items[0].extra - expected) <= 1
    assert abs(items[1].time_ps - items[0].time_ps - expected) <= 1
    assert bench.is_set("LEUART0.STATUS.TXC")
    assert bench.machine.energy_mode == 2


def test_leuart_commands_take_two_to_three_clocks() -> None:
    bench = leuart()
    bench["LEUART0.CMD"] = 2
    assert bench["LEUART0.SYNCBUSY"] == 2
    assert bench.is_set("LEUART0.STATUS.RXENS")
    bench.run_for(4 * TICK)
    assert bench["LEUART0.SYNCBUSY"] == 0
    assert not bench.is_set("LEUART0.STATUS.RXENS")


def test_later_of_opposite_leuart_commands_wins() -> None:
    bench = leuart()
    bench["LEUART0.CMD"] = mask_of("LEUART.CMD.RXDIS")
    bench["LEUART0.CMD"] = mask_of("LEUART.CMD.RXEN") | mask_of("LEUART.CMD.TXDIS")
    bench.run_for(4 * TICK)
    assert bench.is_set("LEUART0.STATUS.RXENS")
    assert not bench.is_set("LEUART0.STATUS.TXENS")


def test_received_character_wakes_from_em2() -> None:
    bench = leuart(interrupts=True)
    bench["LEUART0.IEN"] = 4
    bench.out(OutgoingKind.SLEEP)
    bench.machine.uart_receive(0x100 | PD5, 0x7E)
    bench.run_for(US)
    assert bench.out(OutgoingKind.SLEEP)[0].value == 0
    assert bench["LEUART0.RXDATA"] == 0x7E


def test_leuart_recognises_start_and_signal_frames() -> None:
    bench = leuart(control=mask_of("LEUART.CTRL.SFUBRX"))
    bench.load("LEUART0", STARTFRAME=0x02, SIGFRAME=0x03, CMD=0x10)
    bench.run_for(4 * TICK)
    for byte in b"ab\x02hi\x03":
        bench.machine.uart_receive(LEUART0, byte)
        if byte == 0x62:
            assert not bench.is_set("LEUART0.STATUS.RXDATAV")
        elif byte > 3 or byte == 2:
            assert bench.is_set("LEUART0.IF.STARTF") == (byte not in b"ab")
    assert bench.is_set("LEUART0.IF.SIGF")
    assert bench["LEUART0.RXDATA"] == 2


def test_leuart_buffers_two_characters_and_the_shift_register() -> None:
    bench = leuart()
    for byte in range(4):
        assert not bench.is_set("LEUART0.IF.RXOF")
        bench.machine.uart_receive(LEUART0, byte)
    assert bench.is_set("LEUART0.IF.RXOF")
    assert [bench["LEUART0.RXDATA"] for _ in range(3)] == [0, 1, 3]


def test_dma_reads_characters_in_em2_with_rxdmawu() -> None:
    bench = leuart(control=mask_of("LEUART.CTRL.RXDMAWU"))
    word = 3 << 26 | 3 << 4 | 1  # basic, four bytes from a fixed address
    bench.dma(0, 16 << 16, 0x4008_401C, 0x2000_1003, word)
    for byte in b"abcd":
        bench.machine.uart_receive(LEUART0, byte)
        bench.run_for(MS)
    assert bench.machine.energy_mode == 2
    assert (bench.machine.peek(0x2000_1000, 4), bench["DMA.IF"]) == (b"abcd", 1)


# -- BURTC --

ULFRCO_2_KHZ = 3 << 12 | 1
ULFRCO = ULFRCO_2_KHZ | 1 << 8
LFRCO = 1 << 12 | 1


def burtc(control: int = 0, **registers: int) -> Bench:
    return low(1).load("RMU", CTRL=0).load("BURTC", CTRL=control, **registers)


def retained(bench: Bench) -> list[int]:
    return [bench[f"BURTC.RET{n}_REG"] for n in range(128)]


def test_backup_domain_is_held_in_reset_until_rmu_releases_it() -> None:
    bench = low(1)
    bench["BURTC.RET0_REG"] = 1
    assert bench["BURTC.RET0_REG"] == 0
    assert "BURSTEN" in bench.log()
    bench["RMU.CTRL"] = 0
    bench["BURTC.RET0_REG"] = 1
    assert bench["BURTC.RET0_REG"] == 1


def test_retention_registers_survive_every_reset_but_power_on() -> None:
    values = [0x1234_0000 + n for n in range(128)]
    bench = burtc(0, **{f"RET{n}_REG": value for n, value in enumerate(values)})
    for cause in (SYSTEM_REQUEST, WATCHDOG):
        bench.reset(cause)
        assert retained(bench.clock("LE")) == values
    bench.reset(POWER_ON)
    assert retained(bench.clock("LE")) == [0] * 128


def test_reset_of_the_backup_domain_keeps_the_retention_registers() -> None:
    bench = burtc(ULFRCO, RET7_REG=77)
    bench["RMU.CTRL"] = mask_of("RMU.CTRL.BURSTEN")
    bench["RMU.CTRL"] = 0
    assert bench["BURTC.CTRL"] == mask_of("BURTC.CTRL.RSTEN")
    assert bench["BURTC.RET7_REG"] == 77


def test_burtc_continues_over_a_reset() -> None:
    bench = burtc(ULFRCO)
    bench.run_for(100 * MS)
    assert abs(bench["BURTC.CNT"] - 100) <= 1
    bench.reset(SYSTEM_REQUEST)
    bench.run_for(100 * MS)
    bench.clock("LE")
    assert abs(bench["BURTC.CNT"] - 200) <= 2


def test_burtc_interrupts_at_its_compare_value() -> None:
    bench = burtc(COMP0=10, IEN=2)
    bench.run_for(MS)
    bench["BURTC.CTRL"] = ULFRCO
    bench.run_for(9 * MS)
    assert not bench.peek("BURTC.IF")
    bench.run_for(4 * MS)
    assert (bench.peek("BURTC.IF"), bench.pending()) == (2, [BURTC_IRQ])


def test_burtc_applies_prescaler_and_lock() -> None:
    bench = burtc(LFRCO | 7 << 8)
    bench.run_for(S)
    assert abs(bench["BURTC.CNT"] - 256) <= 1
    bench.load("BURTC", LOCK=0, CTRL=0)
    assert bench["BURTC.CTRL"] == LFRCO | 7 << 8
    assert "BURTC is locked" in bench.log()
    bench.load("BURTC", LOCK=0xAEE8, CTRL=8)
    assert bench["BURTC.CNT"] == 0


@pytest.mark.parametrize(("prescaler", "hz"), [(0, 2000), (1, 1000), (7, 1000)])
def test_burtc_on_ulfrco_counts_at_2_khz_undivided_and_else_at_1_khz(
    prescaler: int, hz: int
) -> None:
    bench = burtc(ULFRCO_2_KHZ | prescaler << 8)
    bench.run_for(S // 10)
    assert abs(bench["BURTC.CNT"] - hz // 10) <= 1


def test_burtc_write_takes_effect_although_the_part_keeps_entering_em2() -> None:
    bench = low(2, "RTC", interrupts=True).load("RMU", CTRL=0)
    bench.load("RTC", COMP0=15, IEN=2, CTRL=5).load("BURTC", CTRL=ULFRCO, COMP0=1000)
    for _ in range(10):  # wakes and sleeps again each half millisecond
        bench["RTC.IFC"] = 7
        bench.machine.write(NOT_PENDING, 1 << 30)
        bench.run_for(MS // 2)
    assert len(bench.out(OutgoingKind.SLEEP)) > 10
    assert (bench["BURTC.SYNCBUSY"], bench["BURTC.COMP0"]) == (0, 1000)


# -- PCNT --


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
