"""Pins: modes, pulls, outputs, locks, interrupts; the peripheral reflex system (PRS)."""

from itertools import pairwise

import pytest

from .bench import US, WFI, Bench

A, B, F = 0, 1, 5
INPUT, PULL, PUSH_PULL, OR, OR_DOWN, AND, AND_UP = 1, 2, 4, 6, 7, 8, 10


def gpio() -> Bench:
    return Bench().clock("GPIO")


def pins(bench: Bench) -> list[tuple[int, int]]:
    return [(pin, level) for _, pin, level in bench.pins()]


def test_push_pull_pin_follows_its_output() -> None:
    bench = gpio()
    bench["GPIO.PB_DOUT"] = 0x8000
    assert pins(bench) == []
    bench["GPIO.PB_MODEH"] = PUSH_PULL << 28
    assert pins(bench) == [(16 * B + 15, 1)]
    bench["GPIO.PB_DOUTCLR"] = 0x8000
    bench.load("GPIO", PB_DOUTCLR=0x8000, PB_DOUTSET=0x8000, PB_DOUTTGL=0x8000)
    assert pins(bench) == [(31, 0), (31, 1), (31, 0)]
    bench["GPIO.PB_MODEH"] = INPUT << 28
    assert pins(bench) == [(31, -1)]


def test_disabled_pin_reads_0_and_enabled_pin_its_level() -> None:
    bench = gpio()
    bench.machine.pin(A, 3, 1)
    assert bench["GPIO.PA_DIN"] == 0
    bench["GPIO.PA_MODEL"] = INPUT << 12
    assert bench["GPIO.PA_DIN"] == 8
    bench.machine.pin(A, 3, 0)
    assert bench["GPIO.PA_DIN"] == 0


@pytest.mark.parametrize(
    ("mode", "dout", "outside", "level"),
    [
        (PULL, 0, -1, 0),
        (PULL, 1, -1, 1),
        (PULL, 1, 0, 0),
        (PUSH_PULL, 1, 0, 1),
        (OR, 1, 0, 1),
        (OR, 0, 1, 1),
        (OR_DOWN, 0, -1, 0),
        (AND, 0, 1, 0),
        (AND, 1, 0, 0),
        (AND_UP, 1, -1, 1),
        (AND_UP, 0, -1, 0),
    ],
)
def test_gpio_pin_level_follows_mode_and_output(
    mode: int, dout: int, outside: int, level: int
) -> None:
    bench = gpio()
    bench.machine.pin(F, 2, outside)
    bench.load("GPIO", PF_DOUT=dout << 2, PF_MODEL=mode << 8)
    assert bench["GPIO.PF_DIN"] >> 2 == level
    assert bench.machine.pin_level(F, 2) == level


def test_pin_changes_at_the_time_of_the_store() -> None:
    # str r1, [r0] three times, then a loop; r0 is PA_DOUTTGL.
    bench = Bench(0x6001, 0x6001, 0x6001, 0xE7FE)
    bench.clock("GPIO")
    bench["GPIO.PA_MODEL"] = PUSH_PULL
    bench.machine.set_register("r0", 0x4000_6018)
    bench.machine.set_register("r1", 1)
    bench.machine.set_register("pc", 0x100)
    pins(bench)
    bench.run_for(10 * US)
    times = [time for time, _, _ in bench.pins()]
    assert len(times) == 3
    cycles = [(late - early) * 14 / 10**6 for early, late in pairwise(times)]
    assert all(1.9 < one < 3.1 for one in cycles)


def test_locked_port_keeps_its_modes() -> None:
    bench = gpio()
    bench.load("GPIO", LOCK=0, PA_MODEL=PUSH_PULL, EXTIPSELL=1, PA_DOUT=5)
    assert (bench["GPIO.PA_MODEL"], bench["GPIO.EXTIPSELL"], bench["GPIO.PA_DOUT"]) == (0, 0, 5)


def test_locked_pin_keeps_mode_and_level_until_a_reset() -> None:
    bench = gpio()
    bench.load("GPIO", PA_MODEL=PUSH_PULL | PUSH_PULL << 4, PA_PINLOCKN=0xFFFE)
    bench.load("GPIO", PA_PINLOCKN=0xFFFF, PA_MODEL=0, PA_DOUT=3)
    assert (bench["GPIO.PA_MODEL"], bench["GPIO.PA_DOUT"]) == (PUSH_PULL, 2)
    bench.reset()
    bench.clock("GPIO")
    assert bench["GPIO.PA_PINLOCKN"] == 0xFFFF


@pytest.mark.parametrize(("rise", "fall", "edges"), [(1, 0, 1), (0, 1, 1), (1, 1, 2), (0, 0, 0)])
def test_edges_of_the_selected_port_set_the_flag(rise: int, fall: int, edges: int) -> None:
    bench = gpio()
    bench.load("GPIO", PF_MODEL=INPUT << 12, PB_MODEL=INPUT << 12, EXTIPSELL=F << 12)
    bench["GPIO.EXTIRISE"], bench["GPIO.EXTIFALL"] = rise << 3, fall << 3
    seen = 0
    for level in (1, 0):
        bench.machine.pin(B, 3, level)
        assert bench["GPIO.IF"] == 0
        bench.machine.pin(F, 3, level)
        seen += bench["GPIO.IF"] >> 3
        bench["GPIO.IFC"] = 8
    assert seen == edges


def test_odd_and_even_pins_have_separate_interrupts() -> None:
    bench = gpio()
    bench["GPIO.IEN"] = 0xFFFF
    pending = 0xE000_E200
    for flag, line in ((1, 1), (2, 11), (0x4000, 1), (0x8000, 11)):
        bench["GPIO.IFS"] = flag
        assert bench.machine.read(pending) == 1 << line
        bench["GPIO.IFC"] = flag
        bench.machine.write(0xE000_E280, 1 << line)
        assert bench.machine.read(pending) == 0


def test_pin_wakes_the_sleeping_core() -> None:
    bench = Bench(WFI, 0xE7FD)
    bench.clock("GPIO")
    bench["GPIO.PA_MODEL"] = INPUT
    bench["GPIO.EXTIRISE"] = bench["GPIO.IEN"] = 1
    bench.machine.write(0xE000_E100, 2)
    bench.run_for(10 * US)
    assert bench.machine.asleep
    before = bench.machine.instructions
    bench.machine.pin(A, 0, 1)
    bench.run_for(10 * US)
    assert bench.machine.instructions > before


def test_pin_drives_another_pin_through_the_prs() -> None:
    bench = Bench().clock("GPIO", "PRS")
    bench["GPIO.PA_MODEH"] = INPUT << 4
    bench["PRS.CH1_CTRL"] = 1 | 49 << 16  # pin 9
    bench["PRS.ROUTE"] = 2  # channel 1 on PA1
    bench["GPIO.PA_MODEL"] = PUSH_PULL << 4
    pins(bench)
    bench.machine.pin(A, 9, 1)
    bench.machine.pin(A, 9, 0)
    assert pins(bench) == [(1, 1), (1, 0)]
    bench["PRS.SWLEVEL"] = 2
    assert pins(bench) == [(1, 1)]


@pytest.mark.parametrize("pin", [3, 9])
@pytest.mark.parametrize("port", [A, B])
def test_prs_channel_finds_the_level_of_a_pin_that_changed_before(port: int, pin: int) -> None:
    bench = Bench().clock("GPIO", "PRS")
    bench["GPIO.PA_MODEL"] = bench["GPIO.PB_MODEL"] = INPUT << 12
    bench["GPIO.PA_MODEH"] = bench["GPIO.PB_MODEH"] = INPUT << 4
    bench["GPIO.EXTIPSELL" if pin < 8 else "GPIO.EXTIPSELH"] = B << 4 * (pin % 8)
    for level in (1, 0, 1):
        bench.machine.pin(port, pin, level)
    bench["GPIO.PA_MODEL"] = PUSH_PULL << 4
    bench["PRS.ROUTE"] = 2  # channel 1 on PA1
    pins(bench)
    bench["PRS.CH1_CTRL"] = pin % 8 | (48 + pin // 8) << 16
    assert pins(bench) == ([(1, 1)] if port == B else [])


def test_prs_software_pulse_reaches_the_pin() -> None:
    bench = Bench().clock("GPIO", "PRS")
    bench["PRS.ROUTE"] = 1
    bench["GPIO.PA_MODEL"] = PUSH_PULL
    pins(bench)
    bench["PRS.SWPULSE"] = 1
    assert pins(bench) == [(0, 1), (0, 0)]
