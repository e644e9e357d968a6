"""Count the cycles of the Blackfin's operations, compiled by gcc, on gdb's simulator.

    .venv/bin/python -m tests.compiled_costs.blackfin FOLDER [--write]

FOLDER is that of build_blackfin.sh. `--write` writes the counts to the data file of
``firmware_model/mcu/blackfin.py``.

The simulator counts the cycles of each instruction, with jumps and products of several. It does not
count stalls between instructions, which this script adds from its trace: an address register that
has just been loaded from memory delays its use as an address to the fourth instruction, one that
was copied from a data register to the fifth (Analog Devices EE-197, latencies; gcc's description of
the processor has the same two).
"""

import re
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from cubestack.firmware_model.mcu import blackfin
from cubestack.firmware_model.mcu.compiled import CompiledCosts
from tests.compiled_costs import pages
from tests.compiled_costs.counting import Operands, counted_names, main, operands_header, output_of

PAGE = "fidelity-aramis.md"
SOURCE = Path(__file__).with_suffix(".c")
OPTIONS = ("-O2", "-mcpu=bf533", "-fno-math-errno", "-ffp-contract=off")
OPERANDS = 32

FUNCTIONS = ("f32_sqrt", "f32_atan2", "f32_acos", "f32_sin")

#: Entries of the library's operations, by the cost table's names.
LIBRARY = {
    "f32_add": ("addsf3", "subsf3"),
    "f32_mul": ("mulsf3",),
    "f32_div": ("divsf3",),
    "f32_compare": ("eqsf2", "nesf2", "gtsf2", "gesf2", "ltsf2", "lesf2"),
    "f32_convert": ("floatsisf", "fixsfsi"),
}


def operands() -> Operands:
    """Operands by name: C type and values."""
    rng = np.random.default_rng(533)
    values = rng.uniform(-500, 500, (2, OPERANDS))
    return {
        "left": ("float", [*values[0]]),
        "right": ("float", [*values[1]]),
        "square": ("float", [*rng.uniform(1e-3, 1e3, OPERANDS)]),
        "unit": ("float", [*rng.uniform(-1, 1, OPERANDS)]),
        "whole": ("int32_t", [*rng.integers(1, 1 << 24, OPERANDS)]),
        "other": ("int32_t", [*rng.integers(1, 1 << 12, OPERANDS)]),
        "bytes": ("uint8_t", [*rng.integers(0, 256, OPERANDS)]),
        "checks": ("uint8_t", [*rng.integers(0, 256, 2048)]),
    }


def measure(folder: Path) -> CompiledCosts:
    """Compile and count; ``folder`` is that of build_blackfin.sh."""
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "operands.h").write_text(operands_header(operands(), OPERANDS=OPERANDS))
        program, trace = Path(name) / "program", Path(name) / "trace"
        gcc = folder / "bin" / "bfin-elf-gcc"
        output_of(gcc, *OPTIONS, "-msim", f"-I{name}", SOURCE, "-lm", "-o", program)
        run = folder / "bin" / "bfin-elf-run"
        shown = output_of(run, "--trace-insn=on", f"--trace-file={trace}", program)
        symbols = output_of(folder / "bin" / "bfin-elf-nm", program)
        with trace.open(encoding="ascii", errors="replace") as lines:
            parts = [*between_readings(lines, library_entries(symbols))]
    counts = [int(count) for count in re.findall(r"^\w+ (\d+)$", shown, re.MULTILINE)]
    mean, calls = {}, {}
    for number, name in enumerate(counted_names(SOURCE)):
        # Every other part is outside of what is counted.
        mine = parts[1::2][number * OPERANDS : (number + 1) * OPERANDS]
        mean[name] = (counts[number] + sum(stalls for stalls, _ in mine)) / OPERANDS
        called = sum((entered for _, entered in mine), Counter[str]())
        calls[name] = {part: count / OPERANDS for part, count in sorted(called.items())}
    return CompiledCosts(
        compiler=output_of(gcc, "--version").splitlines()[0],
        options=" ".join(OPTIONS),
        simulator=output_of(run, "--version").splitlines()[0],
        operations=_operations(mean),
        routines={},
        calls={name: calls[name] for name in FUNCTIONS},
    )


def _operations(mean: Mapping[str, float]) -> dict[str, float]:
    """Cycles of the cost table's operations, without the cost of counting."""

    def beyond(plain: str, *names: str) -> dict[str, float]:
        return {name: mean[name] - mean[plain] for name in names}

    return {
        **beyond("plain_float", "f32_add", "f32_mul", "f32_div", "f32_sqrt"),
        **beyond("plain_float", "f32_atan2", "f32_acos", "f32_sin"),
        **beyond("plain_compare", "f32_compare"),
        **beyond("plain_whole", "f32_convert", "i32_add", "i32_mul", "i32_div"),
        **beyond("plain_byte", "table_byte"),
        "loop": (mean["loop_20"] - mean["loop_10"]) / 10 - 1,  # its body is one cycle
        **beyond("nothing", "call", "coded_word", "correction"),
        **beyond("nothing", "uart_interrupt", "frame_interrupt"),
    }


#: Stalls of an instruction that uses an address register as an address, by the kind of the
#: instruction that wrote it, if that is the one before; one less for each instruction in between.
_LOADED, _COPIED = 3, 4
_WRITTEN = re.compile(r"\b(P[0-5]|FP) = (?:(\[|W\[|B\[)|(R[0-7])\b)")
_ADDRESS = re.compile(r"\[(P[0-5]|FP)\b|\((P[0-5])\)")


def library_entries(symbols: str) -> dict[str, str]:
    """The cost table's name of a library's operation, by its address as the trace prints it."""
    names = {f"___{entry}": name for name, entries in LIBRARY.items() for entry in entries}
    found = re.findall(r"^(\w+) T (\w+)$", symbols, re.MULTILINE)
    return {f"0x{address[2:]}": names[name] for address, name in found if name in names}


def between_readings(
    lines: Iterable[str], entries: Mapping[str, str]
) -> Iterator[tuple[int, Counter[str]]]:
    """Stalls, and calls of the library's operations, between two readings of CYCLES."""
    ready: dict[str, int] = {}  #: by register, when an instruction can use it as an address
    cycle = stalls = 0
    calls = Counter[str]()
    for line in lines:
        cycle += 1
        for found in _ADDRESS.finditer(line):
            late = max(ready.pop(found[1] or found[2], 0) - cycle, 0)
            cycle, stalls = cycle + late, stalls + late
        for found in _WRITTEN.finditer(line):
            ready[found[1]] = cycle + 1 + (_LOADED if found[2] else _COPIED)
        if (name := entries.get(line[10:18])) is not None:
            calls[name] += 1
        if "= CYCLES" in line:
            yield stalls, calls
            stalls, calls = 0, Counter()


def tables() -> Mapping[str, str]:
    """Tables of ``PAGE`` by the name of their marks."""
    libraries = {
        f"`library={name}`": blackfin.blackfin_bf533(library=name) for name in blackfin.LIBRARIES
    }
    return {"costs": pages.costs_markdown(libraries)}


if __name__ == "__main__" and main("blackfin", measure):
    pages.rewrite(PAGE, tables())
