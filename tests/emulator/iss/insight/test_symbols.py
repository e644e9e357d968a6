from cubestack.emulator.iss.insight.symbols import Symbols


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
