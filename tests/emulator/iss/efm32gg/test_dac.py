"""DAC: voltages at its pins and inside of the part, times, triggers, DMA."""

import pytest

from tests.together import together

from .bench import MS, US, Bench, S, address_of, asleep, mask_of

HZ = 14_000_000
VDD, SUPPLY_V = 9, 3.3
OUT0, OUT1 = (1, 11), (1, 12)
OFF, PIN, ADC, BOTH = range(4)
DIFF = mask_of("DAC.CTRL.DIFF")
DAC_IRQ, DMA_SOURCE = 8, 10


def dac(outmode: int = PIN, reference: int = 0, more: int = 0) -> Bench:
    bench = asleep(1, interrupts=False).clock("DAC0", "ADC0", "ACMP0", "PRS", "TIMER0")
    bench.machine.analog[VDD] = SUPPLY_V
    bench["DAC0.CTRL"] = outmode << 4 | reference << 8 | more
    return bench


def settled(bench: Bench, data: int, channel: int = 0) -> Bench:
    bench.load("DAC0", **{f"CH{channel}CTRL": 1, f"CH{channel}DATA": data})
    bench.run_for(100 * US)
    return bench


@together("code", [0, 1, 2048, 4095])
@together(("reference", "volts"), [(0, 1.25), (1, 2.5), (2, SUPPLY_V)])
@together("channel", [0, 1])
def test_pin_has_the_voltage_of_the_code(
    channel: int, reference: int, volts: float, code: int
) -> None:
    bench = settled(dac(reference=reference), code, channel)
    pins = (OUT0, OUT1)
    assert bench.machine.pin_millivolts(*pins[channel]) == pytest.approx(1000 * volts * code / 4095)
    assert bench.machine.pin_millivolts(*pins[1 - channel]) is None
    assert bench.machine.pin_millivolts(0, 0) is None


def test_difference_is_signed_and_around_half_of_the_reference() -> None:
    for code, volts in ((0x7FF, 2.5), (0, 0.0), (0x801, -2.5), (0x400, 2.5 * 1024 / 2047)):
        machine = settled(dac(reference=1, more=DIFF), code).machine
        low, high = machine.pin_millivolts(*OUT0), machine.pin_millivolts(*OUT1)
        assert low is not None
        assert high is not None
        assert high - low == pytest.approx(1000 * volts)
        assert (high + low) / 2 == pytest.approx(1250)


@pytest.mark.parametrize(
    ("outmode", "at_pin"), [(OFF, False), (PIN, True), (ADC, False), (3, True)]
)
def test_output_mode_leads_the_voltage_to_pin_and_adc(outmode: int, at_pin: bool) -> None:
    bench = settled(dac(outmode), 3000)
    assert (bench.machine.pin_millivolts(*OUT0) is not None) == at_pin
    bench.load("ADC0", CTRL=14 << 16, SINGLECTRL=13 << 8, CMD=1)
    bench.run_for(MS)
    expected = int(3000 / 4095 * 4096) if outmode & ADC else 0
    assert bench["ADC0.SINGLEDATA"] == expected


def test_comparator_compares_with_the_output() -> None:
    bench = settled(dac(ADC), 2048)
    bench.load("ACMP0", INPUTSEL=12 << 4 | 3, CTRL=1)
    bench.run_for(MS)
    for volts in (0.5, 0.7, 0.6):
        bench.machine.analog[10 + 3] = volts
        bench.machine.analog_changed()
        assert bench.is_set("ACMP0.STATUS.ACMPOUT") == (volts > 1.25 * 2048 / 4095)
    settled(bench, 1000)  # 0.31 V
    assert bench.is_set("ACMP0.STATUS.ACMPOUT")


@pytest.mark.parametrize("prescaler", range(8))
def test_conversion_takes_two_clocks(prescaler: int) -> None:
    bench = dac(more=prescaler << 16)
    began = bench.now
    span = 2 * S * (1 << prescaler) // HZ
    bench.load("DAC0", CH0CTRL=1, CH0DATA=4095)
    bench.run_until(began + span - 1000)
    assert bench.machine.pin_millivolts(*OUT0) is None
    bench.run_until(began + span + 1000)
    assert bench.machine.pin_millivolts(*OUT0) == 1250


def test_second_value_waits_for_the_running_conversion() -> None:
    bench = dac(more=7 << 16)
    bench.load("DAC0", IEN=1, CH0CTRL=1, CH0DATA=1000)
    assert not bench.is_set("DAC0.STATUS.CH0DV")
    bench.load("DAC0", CH0DATA=2000)
    assert bench.is_set("DAC0.STATUS.CH0DV")
    bench.run_for(MS)
    assert not bench.is_set("DAC0.STATUS.CH0DV")
    assert bench.machine.pin_millivolts(*OUT0) == pytest.approx(1250 * 2000 / 4095)
    assert bench.is_set("DAC0.IF.CH0")
    bench.run_for(MS)


def test_interrupt_says_that_new_data_can_be_written() -> None:
    bench = Bench().clock("DAC0")
    bench.machine.write(0xE000_E100, 0)
    bench.load("DAC0", IEN=1, CH0CTRL=1)
    assert bench.pending() == []
    bench["DAC0.CH0DATA"] = 5
    assert bench.pending() == [DAC_IRQ]


def test_reflex_signal_triggers_and_finds_no_data() -> None:
    bench = dac()
    bench.load("DAC0", CH1CTRL=1 | 4 | 5 << 4, CH1DATA=4095)
    bench.run_for(MS)
    assert bench.machine.pin_millivolts(*OUT1) is None
    bench["PRS.SWPULSE"] = 1 << 5
    bench.run_for(MS)
    assert bench.machine.pin_millivolts(*OUT1) == 1250
    assert not bench.is_set("DAC0.IF.CH1UF")
    bench["PRS.SWPULSE"] = 1 << 5
    assert bench.is_set("DAC0.IF.CH1UF")


def test_dma_plays_a_wave_at_the_rate_of_a_timer() -> None:
    bench = dac()
    wave = [0, 1000, 4095, 2000]
    bench.machine.poke(0x2000_1000, b"".join(one.to_bytes(2, "little") for one in wave))
    bench.load("PRS", CH0_CTRL=28 << 16 | 1).load("DAC0", CH0CTRL=1 | 4)
    halfwords = 3 << 30 | 1 << 28 | 1 << 26 | 1 << 24 | (len(wave) - 1) << 4 | 1
    bench.dma(0, DMA_SOURCE << 16, 0x2000_1006, address_of("DAC0.CH0DATA"), halfwords)
    bench.load("TIMER0", TOP=1399, CMD=1)  # 100 us
    found = []
    bench.run_for(50 * US)
    for _ in wave:
        bench.run_for(100 * US)
        found.append(bench.machine.pin_millivolts(*OUT0))
    assert found == pytest.approx([1250 * code / 4095 for code in wave])


def test_disabled_channel_drives_nothing() -> None:
    bench = settled(dac(), 100)
    bench["DAC0.CH0CTRL"] = 0
    assert bench.machine.pin_millivolts(*OUT0) is None
    bench["DAC0.CTRL"] = PIN << 4 | mask_of("DAC.CTRL.SINEMODE")
    assert "sine mode" in bench.log()
