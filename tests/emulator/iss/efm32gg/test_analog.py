"""ADC: voltages, temperature, conversion times; comparators and their interrupts."""

import pytest

from tests.together import together

from .bench import MS, US, Bench, S, asleep, mask_of

HZ = 14_000_000
TEMPERATURE, VDD = 8, 9
ACMP0, ACMP1 = 10, 18
ADC_IRQ, ACMP_IRQ, VCMP_IRQ = 7, 6, 33
V1_25, V2_5, SUPPLY, V5_DIFF, SUPPLY_TWICE = 0, 1, 2, 3, 6


def adc(**registers: int) -> Bench:
    bench = asleep(1, interrupts=False).clock("ADC0")
    bench.machine.analog[VDD] = 3.3
    bench.machine.analog[TEMPERATURE] = 25.0
    bench["ADC0.CTRL"] = 14 << 16 | 0 << 8  # 14 MHz: 15 cycles per microsecond
    return bench.load("ADC0", **registers)


def control(channel: int, reference: int = V2_5, resolution: int = 0, more: int = 0) -> int:
    return channel << 8 | reference << 16 | resolution << 4 | more


def convert(bench: Bench, word: int) -> int:
    bench.load("ADC0", SINGLECTRL=word, CMD=1)
    assert bench.is_set("ADC0.STATUS.SINGLEACT")
    bench.run_for(MS)
    assert bench.is_set("ADC0.STATUS.SINGLEDV")
    return bench["ADC0.SINGLEDATA"]


@together("channel", range(8))
@together(
    ("reference", "full"),
    [(V1_25, 1.25), (V2_5, 2.5), (SUPPLY, 3.3), (V5_DIFF, 5.0), (SUPPLY_TWICE, 6.6)],
)
def test_voltage_is_converted_to_its_code(channel: int, reference: int, full: float) -> None:
    bench = adc()
    bench.machine.analog[channel] = 1.0
    assert convert(bench, control(channel, reference)) == int(1.0 / full * 4096)


@pytest.mark.parametrize(("volts", "code"), [(-0.1, 0), (0.0, 0), (2.4999, 4095), (3.0, 4095)])
def test_adc_codes_saturate(volts: float, code: int) -> None:
    bench = adc()
    bench.machine.analog[0] = volts
    assert convert(bench, control(0)) == code


@pytest.mark.parametrize(("resolution", "bits"), [(0, 12), (1, 8), (2, 6)])
def test_adc_supports_resolutions_and_left_adjustment(resolution: int, bits: int) -> None:
    bench = adc()
    bench.machine.analog[0] = 1.3
    code = int(1.3 / 2.5 * (1 << bits))
    assert convert(bench, control(0, resolution=resolution)) == code
    assert convert(bench, control(0, resolution=resolution, more=4)) == code << (16 - bits)


@pytest.mark.parametrize(("oversampling", "bits"), [(0, 13), (1, 14), (3, 16), (8, 16)])
def test_oversampling_adds_bits(oversampling: int, bits: int) -> None:
    bench = adc()
    bench["ADC0.CTRL"] |= oversampling << 24
    bench.machine.analog[0] = 1.3
    assert convert(bench, control(0, resolution=3)) == int(1.3 / 2.5 * (1 << bits))


def test_differential_adc_codes_are_signed() -> None:
    bench = adc()
    bench.machine.analog[2], bench.machine.analog[3] = 1.0, 1.5
    assert convert(bench, control(1, more=2)) == (-410) & 0xFFFF_FFFF


@pytest.mark.parametrize("celsius", [-40.0, 0.0, 25.0, 60.5, 85.0])
def test_temperature_by_the_calibration_of_the_device_information(celsius: float) -> None:
    bench = adc()
    bench.machine.analog[TEMPERATURE] = celsius
    code = convert(bench, control(8, V1_25))
    calibrated_at = bench.machine.peek(0x0FE0_81B2, 1)[0]
    reading = int.from_bytes(bench.machine.peek(0x0FE0_81BE, 2), "little") >> 4
    assert abs(calibrated_at - (reading - code) / -6.27 - celsius) < 0.2


def test_adc_converts_internal_voltages() -> None:
    bench = adc()
    assert convert(bench, control(9)) == int(1.1 / 2.5 * 4096)
    assert convert(bench, control(10, SUPPLY_TWICE)) == 2048
    assert convert(bench, control(11)) == 0
    assert convert(bench, control(12)) == 2048


@pytest.mark.parametrize(
    ("acquisition", "prescaler", "resolution", "clocks"),
    [(0, 0, 0, 14), (4, 0, 0, 29), (8, 3, 0, 269), (0, 1, 1, 10), (0, 0, 2, 8)],
)
def test_adc_conversion_takes_the_documented_time(
    acquisition: int, prescaler: int, resolution: int, clocks: int
) -> None:
    bench = adc()
    bench["ADC0.CTRL"] = 14 << 16 | prescaler << 8
    bench.load("ADC0", SINGLECTRL=control(0, V2_5, resolution, acquisition << 20), CMD=1)
    wanted = (5 * 15 + clocks * (prescaler + 1)) * S // HZ  # warm-up and conversion
    began = bench.now
    bench.run_until(began + wanted - US // 2)
    assert not bench.peek("ADC0.IF")
    bench.run_until(began + wanted + US // 2)
    assert bench.peek("ADC0.IF") == 1


def test_warm_converter_is_faster() -> None:
    bench = adc()
    bench["ADC0.CTRL"] |= 3
    convert(bench, control(0))
    bench.load("ADC0", IFC=3, CMD=1)
    bench.run_for(3 * US // 2)
    assert bench["ADC0.IF"] == 1


def test_unread_result_sets_overflow() -> None:
    bench = adc(SINGLECTRL=control(0))
    for overflow in (0, 0x100):
        bench["ADC0.CMD"] = 1
        bench.run_for(MS)
        assert bench["ADC0.IF"] & 0x100 == overflow


def test_repetition_continues_until_stopped() -> None:
    bench = adc(SINGLECTRL=control(0, more=1))
    bench["ADC0.CMD"] = 1
    for _ in range(3):
        bench.run_for(20 * US)
        assert bench.is_set("ADC0.STATUS.SINGLEDV")
        bench["ADC0.SINGLEDATA"]
    bench["ADC0.CMD"] = 2
    bench.run_for(20 * US)
    assert not bench.is_set("ADC0.STATUS.SINGLEACT")


def test_adc_scan_of_several_channels_is_read_by_dma() -> None:
    bench = adc()
    for channel in range(8):
        bench.machine.analog[channel] = 0.25 * channel
    word = 1 | 3 << 4 | 2 << 24 | 3 << 26 | 2 << 28 | 2 << 30
    bench.dma(0, 8 << 16 | 1, 0x4000_2028, 0x2000_1000 + 12, word)
    bench.load("ADC0", SCANCTRL=V2_5 << 16 | 0b1010_1010 << 8, CMD=4)
    bench.run_for(MS)
    found = [bench.machine.read(0x2000_1000 + 4 * n) for n in range(4)]
    assert found == [int(0.25 * n / 2.5 * 4096) for n in (1, 3, 5, 7)]
    assert not bench.is_set("ADC0.STATUS.SCANACT")
    assert bench["DMA.IF"] == 1


def test_adc_conversion_raises_an_interrupt() -> None:
    bench = adc(SINGLECTRL=control(0), IEN=1)
    bench["ADC0.CMD"] = 1
    bench.run_for(MS)
    assert bench.pending() == [ADC_IRQ]


# -- comparators --

EDGES = 3 << 16
NEGATIVE_VDD, NEGATIVE_1V25 = 10 << 4, 8 << 4


def acmp(unit: str = "ACMP0", *, select: int = NEGATIVE_VDD | 32 << 8, more: int = EDGES) -> Bench:
    bench = asleep(1, interrupts=False).clock("ACMP0", "ACMP1", "VCMP")
    bench.machine.analog[VDD] = 3.3
    bench[f"{unit}.INPUTSEL"] = select
    bench[f"{unit}.IEN"] = 1
    bench[f"{unit}.CTRL"] = 1 | more
    return bench


def apply(bench: Bench, index: int, volts: float) -> None:
    bench.machine.analog[index] = volts
    bench.machine.analog_changed()


@pytest.mark.parametrize("warm_time", range(8))
def test_comparator_is_active_after_its_warm_up_time(warm_time: int) -> None:
    bench = acmp(more=warm_time << 8)
    bench.run_for((4 << warm_time) * S // HZ - 4 * S // HZ)
    if warm_time > 1:
        assert not bench.peek("ACMP0.STATUS") & 1
    bench.run_for(8 * S // HZ)
    assert bench.peek("ACMP0.STATUS") & 1
    assert bench["ACMP0.IF"] & 2


@pytest.mark.parametrize(("unit", "base"), [("ACMP0", ACMP0), ("ACMP1", ACMP1)])
def test_comparator_interrupts_at_its_level(unit: str, base: int) -> None:
    bench = acmp(unit)
    bench.run_for(MS)
    level = 3.3 * 32 / 63
    apply(bench, base, level - 0.01)
    assert not bench.is_set(f"{unit}.STATUS.ACMPOUT")
    apply(bench, base, level + 0.01)
    assert bench.is_set(f"{unit}.STATUS.ACMPOUT")
    assert bench[f"{unit}.IF"] & 1
    assert bench.pending() == [ACMP_IRQ]
    bench[f"{unit}.IFC"] = 1
    apply(bench, base, 0.0)
    assert bench[f"{unit}.IF"] & 1


@pytest.mark.parametrize(("sense", "rise", "fall"), [(1, 1, 0), (2, 0, 1), (0, 0, 0)])
def test_only_the_selected_edge_sets_the_flag(sense: int, rise: int, fall: int) -> None:
    bench = acmp(more=sense << 16)
    bench.run_for(MS)
    bench["ACMP0.IFC"] = 3
    apply(bench, ACMP0, 3.0)
    assert bench["ACMP0.IF"] == rise
    bench["ACMP0.IFC"] = 3
    apply(bench, ACMP0, 0.0)
    assert bench["ACMP0.IF"] == fall


def test_comparator_follows_its_input_selection_and_the_supply() -> None:
    bench = acmp(select=NEGATIVE_1V25 | 3)
    bench.run_for(MS)
    apply(bench, ACMP0 + 3, 1.3)
    assert bench.is_set("ACMP0.STATUS.ACMPOUT")
    bench["ACMP0.INPUTSEL"] = NEGATIVE_VDD | 30 << 8 | 3
    assert not bench.is_set("ACMP0.STATUS.ACMPOUT")
    apply(bench, VDD, 2.5)
    assert bench.is_set("ACMP0.STATUS.ACMPOUT")


def test_comparator_applies_its_hysteresis() -> None:
    bench = acmp(select=NEGATIVE_1V25, more=EDGES | 7 << 4)
    bench.run_for(MS)
    for volts, output in ((1.30, False), (1.31, True), (1.20, True), (1.19, False)):
        apply(bench, ACMP0, volts)
        assert bench.is_set("ACMP0.STATUS.ACMPOUT") == output


def test_comparator_wakes_from_em2() -> None:
    bench = asleep(2).clock("ACMP0")
    bench.machine.analog[VDD] = 3.3
    bench.machine.reset(1)  # warm up awake, then sleep
    bench.clock("ACMP0")
    bench.load("ACMP0", INPUTSEL=NEGATIVE_1V25, IEN=1, CTRL=1 | EDGES)
    bench.machine.write(0xE000_ED10, 4)
    bench.machine.write(0xE000_E100, 1 << ACMP_IRQ)
    bench.run_for(400 * US)
    assert bench.machine.energy_mode >= 2
    apply(bench, ACMP0, 2.0)
    bench.run_for(10 * US)
    assert bench.machine.energy_mode == 0


def test_supply_comparator_detects_low_voltage() -> None:
    bench = acmp()
    bench["VCMP.INPUTSEL"] = 30  # 1.667 V + 30 * 34 mV
    bench.load("VCMP", IEN=1, CTRL=1 | EDGES)
    bench.run_for(MS)
    assert bench.is_set("VCMP.STATUS.VCMPOUT")
    bench["VCMP.IFC"] = 3
    apply(bench, VDD, 2.6)
    assert not bench.is_set("VCMP.STATUS.VCMPOUT")
    assert (bench["VCMP.IF"], bench.pending()) == (mask_of("VCMP.IF.EDGE"), [VCMP_IRQ])
