"""Clock management unit: start-up, selection, dividers, synchronisation; time stays exact."""

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .bench import MS, US, Bench, S, mask_of

HFXO, LFRCO, LFXO = 2, 3, 4


def test_part_starts_at_14_mhz() -> None:
    bench = Bench()
    assert (bench.machine.hz, bench["CMU.STATUS"]) == (14_000_000, 0x403)


@pytest.mark.parametrize(
    ("name", "start_ps", "flag"),
    [
        ("HFXO", 400 * US + 16384 * S // 48_000_000, "HFXORDY"),
        ("LFRCO", 150 * US, "LFRCORDY"),
        ("LFXO", 400 * MS + 32768 * S // 32768, "LFXORDY"),
        ("AUXHFRCO", US * 6 // 10, "AUXHFRCORDY"),
    ],
)
def test_oscillator_is_ready_after_its_start_up_time(name: str, start_ps: int, flag: str) -> None:
    bench = Bench()
    began = bench.now
    bench.command(f"CMU.OSCENCMD.{name}EN")
    assert bench.is_set(f"CMU.STATUS.{name}ENS")
    bench.run_until(began + start_ps - US // 2)
    assert not bench.peek("CMU.STATUS") & mask_of(f"CMU.STATUS.{name}RDY")
    assert not bench.peek("CMU.IF") & mask_of(f"CMU.IF.{flag}")
    bench.run_until(began + start_ps + US)
    assert bench.is_set(f"CMU.STATUS.{name}RDY")
    assert bench.is_set(f"CMU.IF.{flag}")
    bench.command(f"CMU.OSCENCMD.{name}DIS")
    assert not bench.is_set(f"CMU.STATUS.{name}RDY")


def test_selecting_a_starting_clock_stops_the_core_until_it_runs() -> None:
    bench = Bench()
    bench["MSC.READCTRL"] = 4
    bench.command("CMU.OSCENCMD.HFXOEN")
    began, count = bench.now, bench.machine.instructions
    bench["CMU.CMD"] = HFXO
    assert bench.is_set("CMU.STATUS.HFRCOSEL")
    bench.run_until(began + 700 * US)
    assert bench.machine.instructions - count < 5
    bench.run_until(began + 900 * US)
    assert bench.is_set("CMU.STATUS.HFXOSEL")
    assert bench.machine.hz == 48_000_000
    assert bench.machine.instructions - count > 1000


def test_selecting_a_disabled_clock_is_reported_and_ignored() -> None:
    bench = Bench()
    bench["CMU.CMD"] = LFXO
    assert bench.is_set("CMU.STATUS.HFRCOSEL")
    assert "HFCLKSEL" in bench.log()


def test_oscillator_of_the_core_cannot_be_switched_off() -> None:
    bench = Bench()
    bench.command("CMU.OSCENCMD.HFRCODIS")
    assert bench.is_set("CMU.STATUS.HFRCORDY")
    assert "cannot be switched off" in bench.log()


def test_low_frequency_registers_wait_for_their_clock() -> None:
    bench = Bench()
    bench["CMU.LFACLKEN0"] = 2
    bench.run_for(MS)
    assert bench["CMU.SYNCBUSY"] == 1  # LFRCO is off
    bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.run_for(150 * US + 4 * S // 32768)
    assert bench["CMU.SYNCBUSY"] == 0
    bench["CMU.LFAPRESC0"] = 0x20
    assert bench["CMU.SYNCBUSY"] == 4
    bench.run_for(4 * S // 32768)
    assert bench["CMU.SYNCBUSY"] == 0


def test_freeze_delays_low_frequency_registers() -> None:
    bench = Bench()
    bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.run_for(200 * US)
    bench.load("CMU", FREEZE=1, LFACLKEN0=2)
    bench.run_for(MS)
    assert bench["CMU.SYNCBUSY"] == 1
    bench["CMU.FREEZE"] = 0
    bench.run_for(4 * S // 32768)
    assert bench["CMU.SYNCBUSY"] == 0


@pytest.mark.parametrize("count", [9, 999])
def test_calibration_counts_one_clock_by_another(count: int) -> None:
    bench = Bench()
    bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.run_for(200 * US)
    bench["CMU.CALCTRL"] = 2 | 4 << 3  # up: HFRCO, down: LFRCO
    bench["CMU.CALCNT"] = count
    bench.command("CMU.CMD.CALSTART")
    assert bench.is_set("CMU.STATUS.CALBSY")
    bench.run_for((count + 2) * S // 32768)
    assert bench.is_set("CMU.IF.CALRDY")
    assert bench["CMU.CALCNT"] == (count + 1) * 14_000_000 // 32768


def test_too_few_wait_states_are_reported() -> None:
    bench = Bench()
    bench["MSC.READCTRL"] = 0
    assert bench.log() == ""
    bench["CMU.HFRCOCTRL"] = 5 << 8 | 0x80
    assert "flash with WS0 at 28000000 Hz" in bench.log()


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0, 1, 2, 3, 4]),  # band
            st.integers(0, 9),  # core divider
            st.integers(0, 7),  # HFCLK divider
            st.integers(0, 255),  # tuning
            st.integers(1, 3_000_000),  # time until the next change, ns
        ),
        max_size=8,
    )
)
def test_time_is_exact_across_clock_changes(steps: list[tuple[int, int, int, int, int]]) -> None:
    bench = Bench()
    low, high, cycles = Fraction(bench.now), Fraction(bench.now), bench.machine.cycles
    hz = Fraction(14_000_000)
    bands = [1_200_000, 6_600_000, 11_000_000, 14_000_000, 21_000_000]

    def check() -> None:
        """Each cycle took its period; a clock change rounds down by less than 1 ps."""
        nonlocal low, high, cycles
        passed = (bench.machine.cycles - cycles) * S / hz
        low, high, cycles = low + passed - 1, high + passed, bench.machine.cycles
        assert low <= bench.now <= high

    for band, divider, prescaler, tuning, wait_ns in steps:
        bench.run_for(wait_ns * 1000)
        for name, value in (
            ("CMU.HFRCOCTRL", band << 8 | tuning),
            ("CMU.HFCORECLKDIV", divider),
            ("CMU.CTRL", 0xC262C | prescaler << 14),
        ):
            bench[name] = value
        low = high = Fraction(bench.now)
        cycles = bench.machine.cycles
        source = bands[band] * (1000 + 3 * (tuning - 128)) // 1000
        hz = Fraction(source, (prescaler + 1) << divider)
        assert bench.machine.hz == int(hz)
        high += 1
        low -= 1
        bench.run_for(wait_ns * 500)
        check()
