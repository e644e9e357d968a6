"""Count the cycles of the Blackfin's operations, compiled by gcc, on gdb's simulator.

    .venv/bin/python -m tests.compiled_costs.blackfin FOLDER [--write]

FOLDER is that of build_blackfin.sh. `--write` writes the counts to the data file of
``firmware_model/mcu/blackfin.py``.

The simulator counts the cycles of each instruction, with jumps and products of several. It does not
count stalls between instructions, which this script adds from its trace: an address register that
has just been loaded from memory delays its use as an address to the fourth instruction, one that was
copied from a data register to the fifth (Analog Devices EE-197, latencies; gcc's description of the
processor has the same two).
"""

import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from cubestack.firmware_model.mcu import blackfin
from cubestack.firmware_model.mcu.compiled import CompiledCosts
from tests.compiled_costs import pages
from tests.compiled_costs.counting import (
    Operands,
    counted_names,
    main,
    operands_header,
    output_of,
)

PAGE = "fidelity-aramis.md"
SOURCE = Path(__file__).with_suffix(".c")
OPTIONS = ("-O2", "-mcpu=bf533", "-fno-math-errno", "-ffp-contract=off")
OPERANDS = 32


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
        run = (folder / "bin" / "bfin-elf-run", "--env", "operating")
        shown = output_of(*run, "--trace-insn=on", f"--trace-file={trace}", program)
        lines = trace.read_text("ascii", "replace").splitlines()
    counts = {name: int(sum_) for name, sum_ in re.findall(r"^(\w+) (\d+)$", shown, re.MULTILINE)}
    stalls = dict(zip(counted_names(SOURCE), _stalls(lines), strict=True))
    mean = {name: (count + stalls[name]) / OPERANDS for name, count in counts.items()}
    return CompiledCosts(
        compiler=output_of(gcc, "--version").splitlines()[0],
        options=" ".join(OPTIONS),
        simulator=output_of(*run[:1], "--version").splitlines()[0],
        operations=_operations(mean),
        routines={},
    )
