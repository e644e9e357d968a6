import pytest

from cubestack.emulator.iss.insight.fault_report import fault_report, last_fault, reasons, unhandled
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason

PS_PER_MS = 10**9
MOST_RUNS = 10_000
SCREEN = 32
"""Lines."""


def run(machine: Machine, until_ps: int) -> None:
    """Up to a time, or to a handler without an end."""
    for _ in range(MOST_RUNS):
        stop = machine.run(until_ps)
        list(machine.outbox())
        locked_up = stop.reason is StopReason.LOCKED_UP
        if stop.now_ps >= until_ps or locked_up or unhandled(machine):
            return
    pytest.fail(f"stands at {machine.now_ps} ps")


def crash(machine: Machine, symbols: Symbols, how: int) -> str:
    """Let the program fail; the report."""
    run(machine, PS_PER_MS)
    machine.poke(symbols.variables["command"].address, how.to_bytes(4, "little"))
    run(machine, 300 * PS_PER_MS)
    report = fault_report(machine, symbols, machine.now_ps)
    assert len(report.splitlines()) <= SCREEN
    assert all(len(line) <= 100 for line in report.splitlines())
    return report


def test_no_fault_so_far(machine: Machine, symbols: Symbols) -> None:
    run(machine, PS_PER_MS)
    assert not unhandled(machine)
    assert last_fault(machine).count == 0
    assert "no fault so far" in fault_report(machine, symbols, machine.now_ps)


def test_a_division_by_zero(machine: Machine, symbols: Symbols) -> None:
    report = crash(machine, symbols, 1)
    assert unhandled(machine)
    assert "UsageFault DIVBYZERO: divided by zero" in report
    assert "HardFault FORCED" in report
    names = [line.split()[2].split("+")[0] for line in report.splitlines() if " #" in line]
    assert names[:4] == ["HardFault_Handler", "divide", "crash", "main"]
    assert "(program.c:" in report


def test_a_jump_into_nowhere(machine: Machine, symbols: Symbols) -> None:
    report = crash(machine, symbols, 2)
    assert "IBUSERR" in report or "IACCVIOL" in report
    assert "faulting instruction 60000000" in report


def test_a_write_into_nowhere(machine: Machine, symbols: Symbols) -> None:
    report = crash(machine, symbols, 4)
    assert "PRECISERR" in report
    assert "crash" in report


def test_a_stack_that_runs_over_still_gives_a_report(machine: Machine, symbols: Symbols) -> None:
    report = crash(machine, symbols, 3)
    assert "has the stack run over?" in report
    assert "overflow" in report


def test_a_program_without_names_gives_a_report(machine: Machine, symbols: Symbols) -> None:
    crash(machine, symbols, 1)
    report = fault_report(machine, Symbols(None), machine.now_ps)
    assert "DIVBYZERO" in report
    assert "[by stack scan]" not in report


def test_every_status_bit_has_its_words() -> None:
    assert reasons(1 << 25 | 1 << 9, 1 << 30) == [
        "BusFault PRECISERR: data access where there is nothing",
        "UsageFault DIVBYZERO: divided by zero",
        "HardFault FORCED: a fault whose own handler is off or can not run now",
    ]
