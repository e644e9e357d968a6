"""Energy modes, reset causes, watchdog."""

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind

from .bench import LOCK_UP, MS, PIN_RESET, POWER_ON, SYSTEM_REQUEST, US, WATCHDOG, WFI, Bench, S

SCR = 0xE000_ED10
DEEP = 4
AIRCR = 0xE000_ED0C
CPSID = 0xB672


def sleeper(*, deep: bool = False) -> Bench:
    """A part that sleeps whenever no interrupt is pending, and serves none. Pin A0 pends one."""
    bench = Bench(CPSID, WFI, 0xE7FD)
    bench.clock("GPIO", "LE")
    bench["GPIO.PA_MODEL"] = 1
    bench["GPIO.EXTIRISE"] = bench["GPIO.IEN"] = 1
    bench.machine.write(0xE000_E100, 2)
    bench.machine.write(SCR, DEEP if deep else 0)
    bench.run_for(US)
    return bench


def fall_asleep(bench: Bench) -> None:
    """Clear the pending interrupt that keeps it awake."""
    bench.machine.pin(0, 0, 0)
    bench["GPIO.IFC"] = 1
    bench.machine.write(0xE000_E280, 2)
    bench.run_for(20 * US)


def wake(bench: Bench) -> None:
    bench.machine.pin(0, 0, 1)
    bench.run_for(20 * US)


def modes(bench: Bench) -> list[int]:
    return [item.value for item in bench.out(OutgoingKind.SLEEP)]


def test_wfi_enters_em1_where_clocks_continue() -> None:
    bench = sleeper()
    cycles = bench.machine.cycles
    bench.run_for(MS)
    assert modes(bench) == [1]
    assert bench.machine.asleep
    assert bench.machine.cycles - cycles == pytest.approx(14_000, rel=0.01)


@pytest.mark.parametrize(("oscillator", "mode"), [("LFRCO", 2), (None, 3)])
def test_deep_sleep_stops_the_core_clock(oscillator: str | None, mode: int) -> None:
    bench = sleeper(deep=True)
    wake(bench)
    if oscillator:
        bench.command(f"CMU.OSCENCMD.{oscillator}EN")
    modes(bench)
    fall_asleep(bench)
    assert modes(bench) == [mode]
    cycles = bench.machine.cycles
    bench.run_for(10 * S)
    assert bench.machine.cycles == cycles
    bench.machine.pin(0, 0, 1)
    bench.run_for(US)
    assert bench.machine.cycles == cycles  # the oscillator starts first
    bench.run_for(3 * US)
    assert bench.machine.cycles > cycles
    assert modes(bench) == [0]


def test_part_wakes_on_the_hfrco() -> None:
    bench = sleeper(deep=True)
    wake(bench)
    bench["MSC.READCTRL"] = 4
    bench.command("CMU.OSCENCMD.HFXOEN")
    bench.run_for(MS)
    bench["CMU.CMD"] = 2
    assert bench.machine.hz == 48_000_000
    fall_asleep(bench)
    assert bench.machine.hz == 0
    wake(bench)
    assert (bench.machine.hz, bench.peek("CMU.STATUS") & 0x40F) == (14_000_000, 0x403)


def test_em2block_limits_sleep_to_em1() -> None:
    bench = sleeper(deep=True)
    wake(bench)
    bench["EMU.CTRL"] = 2
    modes(bench)
    fall_asleep(bench)
    assert modes(bench) == [1]


def test_em4_needs_its_sequence_and_a_pin_ends_it_by_a_reset() -> None:
    bench = Bench().clock("GPIO")
    bench["GPIO.PA_MODEL"] = 1
    bench["GPIO.EM4WUEN"] = bench["GPIO.EM4WUPOL"] = 1
    bench["RMU.CMD"] = 1
    for value in (2, 3, 2, 3, 3, 2, 3, 2, 3, 2, 3, 2, 3):
        bench["EMU.CTRL"] = value << 2
    bench.run_for(US)
    assert modes(bench) == []  # the sequence was broken once: eight of nine writes
    bench["EMU.CTRL"] = 2 << 2
    bench.run_for(S)
    assert modes(bench) == [4]
    bench.out(OutgoingKind.RESET)
    bench.machine.pin(0, 0, 1)
    bench.run_for(MS)
    assert [item.value for item in bench.out(OutgoingKind.RESET)] == [0x180]
    assert bench["RMU.RSTCAUSE"] == 0x180
    bench.clock("GPIO")
    assert bench["GPIO.EM4WUCAUSE"] == 1
    bench["GPIO.CMD"] = 1
    assert bench["GPIO.EM4WUCAUSE"] == 0


# -- resets ----------------------------------------------------------------------------------------


def test_reset_causes_accumulate_until_cleared() -> None:
    bench = Bench()
    assert bench["RMU.RSTCAUSE"] == POWER_ON
    bench.reset(PIN_RESET)
    assert bench["RMU.RSTCAUSE"] == POWER_ON | PIN_RESET
    bench["RMU.CMD"] = 1
    assert bench["RMU.RSTCAUSE"] == 0
    bench.reset(WATCHDOG)
    assert bench["RMU.RSTCAUSE"] == WATCHDOG
    bench.reset(POWER_ON)
    assert bench["RMU.RSTCAUSE"] == POWER_ON


def test_reset_request_resets_registers_but_not_the_ram() -> None:
    bench = Bench()
    bench.clock("GPIO")
    bench.machine.write(0x2000_0100, 0x1234_5678)
    bench["RMU.CMD"] = 1
    bench.machine.write(AIRCR, 0x05FA_0004)
    bench.run_for(MS)
    assert (bench["RMU.RSTCAUSE"], bench["CMU.HFPERCLKEN0"]) == (SYSTEM_REQUEST, 0)
    assert bench.machine.read(0x2000_0100) == 0x1234_5678


def test_lock_up_resets_unless_disabled() -> None:
    undefined = 0xDE00
    bench = Bench(undefined)
    bench.out(OutgoingKind.RESET)
    # The vector table leads every fault to the same instruction.
    bench.run_for(MS)
    resets = bench.out(OutgoingKind.RESET)
    assert resets
    assert all(item.value == LOCK_UP for item in resets)
    bench = Bench(0xE7FE, undefined)
    bench["RMU.CTRL"] = 1
    bench.out(OutgoingKind.RESET)
    bench.machine.set_register("pc", 0x102)
    for vector in range(2, 16):
        bench.machine.flash[4 * vector] = 3
    bench.run_for(MS)
    assert bench.out(OutgoingKind.RESET) == []
    began = bench.now
    bench.run_for(MS)
    assert MS <= bench.now - began < 2 * MS


def test_first_instruction_runs_after_the_start_up_time() -> None:
    bench = Bench()
    bench.machine.reset(PIN_RESET)
    began, count = bench.now, bench.machine.instructions
    bench.run_until(began + 162 * US)
    assert bench.machine.instructions == count
    bench.run_until(began + 164 * US)
    assert bench.machine.instructions > count


# -- the watchdog ----------------------------------------------------------------------------------


def watchdog(control: int) -> Bench:
    bench = Bench().clock("LE")
    bench["RMU.CMD"] = 1
    bench.out(OutgoingKind.RESET)
    bench["WDOG.CTRL"] = control
    return bench


def watchdog_reset(bench: Bench) -> bool:
    return any(item.value == WATCHDOG for item in bench.out(OutgoingKind.RESET))


@pytest.mark.parametrize("period", [0, 3, 7])
def test_watchdog_resets_after_its_period(period: int) -> None:
    bench = watchdog(1 | period << 8)
    bench.run_for(3 * MS)  # synchronised
    bench.run_for((8 << period) * MS - 2 * MS)
    assert not watchdog_reset(bench)
    bench.run_for(3 * MS)
    assert watchdog_reset(bench)
    assert bench["RMU.RSTCAUSE"] == WATCHDOG


def test_cleared_watchdog_does_not_reset() -> None:
    bench = watchdog(1 | 1 << 8)
    for _ in range(20):
        bench.run_for(10 * MS)
        bench["WDOG.CMD"] = 1
    assert not watchdog_reset(bench)
    bench.run_for(30 * MS)
    assert watchdog_reset(bench)


def test_locked_watchdog_cannot_be_stopped() -> None:
    bench = watchdog(1 | 1 << 4)
    bench.run_for(4 * MS)
    bench["WDOG.CTRL"] = 0
    assert bench["WDOG.CTRL"] == 0x11
    bench.run_for(20 * MS)
    assert watchdog_reset(bench)


@pytest.mark.parametrize(("runs", "resets"), [(0, False), (1 << 3, True)])
def test_watchdog_runs_in_deep_sleep_if_configured(runs: int, resets: bool) -> None:
    bench = sleeper(deep=True)
    bench.out(OutgoingKind.RESET)
    wake(bench)
    bench["WDOG.CTRL"] = 1 | runs | 2 << 8
    bench.run_for(4 * MS)
    fall_asleep(bench)
    bench.run_for(S)
    assert watchdog_reset(bench) is resets


def test_watchdog_period_follows_the_crystal() -> None:
    bench = Bench().clock("LE")
    bench.command("CMU.OSCENCMD.LFXOEN")
    bench.run_for(1401 * MS)
    bench["WDOG.CTRL"] = 1 | 2 << 12 | 5 << 8
    began = bench.now
    bench.out(OutgoingKind.RESET)
    bench.run_for(MS * 20)
    (reset,) = bench.out(OutgoingKind.RESET)
    edges = (reset.time_ps - began) * 32768 / S
    assert 257 + 2 <= edges <= 257 + 3.1
