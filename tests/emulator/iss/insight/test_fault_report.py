import pytest

from cubestack.emulator.iss.insight.fault_report import fault_report, last_fault, reasons, unhandled
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine

from .conftest import PS_PER_MS, run

SCREEN_LINES = 32


def crash(machine: Machine, symbols: Symbols, how: int) -> str:
    """Let the program fail; returns the report."""
    run(machine, PS_PER_MS)
    machine.poke(symbols.variables["command"].address, how.to_bytes(4, "little"))
    run(machine, 300 * PS_PER_MS)
    report = fault_report(machine, symbols, machine.now_ps)
    assert len(report.splitlines()) <= SCREEN_LINES
    assert all(len(line) <= 100 for line in report.splitlines())
    return report


def test_fault_report_states_that_no_fault_occurred(machine: Machine, symbols: Symbols) -> None:
    run(machine, PS_PER_MS)
    assert not unhandled(machine)
    assert last_fault(machine).count == 0
    assert "no fault so far" in fault_report(machine, symbols, machine.now_ps)


def test_report_of_a_division_by_zero_has_cause_and_calls(
    machine: Machine, symbols: Symbols
) -> None:
    report = crash(machine, symbols, 1)
    assert unhandled(machine)
    assert "UsageFault DIVBYZERO: division by zero" in report
    assert "HardFault FORCED" in report
    names = [line.split()[2].split("+")[0] for line in report.splitlines() if " #" in line]
    assert names[:4] == ["HardFault_Handler", "divide", "crash", "main"]
    assert "(program.c:" in report


@pytest.mark.parametrize(
    ("how", "texts"),
    [
        pytest.param(2, ["BUSERR", "faulting instruction 60000000"], id="jump to unused address"),
        pytest.param(4, ["PRECISERR", "crash"], id="write to unused address"),
        pytest.param(3, ["stack overflow?", "overflow"], id="stack overflow"),
    ],
)
def test_fault_report_names_the_cause(
    machine: Machine, symbols: Symbols, how: int, texts: list[str]
) -> None:
    report = crash(machine, symbols, how)
    assert all(text in report for text in texts)


def test_fault_report_works_without_symbols(machine: Machine, symbols: Symbols) -> None:
    crash(machine, symbols, 1)
    report = fault_report(machine, Symbols(None), machine.now_ps)
    assert "DIVBYZERO" in report
    assert "[by stack scan]" not in report


def test_status_bits_are_described() -> None:
    assert reasons(1 << 25 | 1 << 9, 1 << 30) == [
        "BusFault PRECISERR: data access to an unused address",
        "UsageFault DIVBYZERO: division by zero",
        "HardFault FORCED: a fault whose own handler is disabled or cannot run now",
    ]


# -- symbols --


def test_functions_are_found_by_address(symbols: Symbols) -> None:
    work = symbols.function("work")
    assert work is not None
    assert symbols.function_at(work.address) == work == symbols.function_at(work.end - 1)
    assert symbols.function_at(work.end) != work
    assert symbols.function_at(0x2000_0000) is None


def test_function_that_the_linker_removed_has_no_lines(symbols: Symbols) -> None:
    assert symbols.function("never") is None
    assert all(symbols.function_at(line.address) for line in symbols.lines)


def test_address_is_described_by_function_and_line(symbols: Symbols) -> None:
    square = symbols.function("square")
    assert square is not None
    text = symbols.describe(square.address)
    assert text.startswith(f"{square.address:08x} square (program.c:")


def test_variables_have_addresses(symbols: Symbols) -> None:
    assert {symbols.variables[name].size for name in ("ticks", "total")} == {4}
    assert symbols.labels["stack_top"] == 0x2002_0000


def test_program_without_elf_file_has_no_symbols() -> None:
    symbols = Symbols(None)
    assert not symbols.functions
    assert not symbols.lines
    assert symbols.describe(0x100) == "00000100"
