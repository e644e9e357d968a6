"""What the counting programs in C have in common: names in their source, operands, output."""

import argparse
import re
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from cubestack.firmware_model.mcu.compiled import CompiledCosts, compiled_costs, write_costs

#: C type and values of operands, by name.
Operands = Mapping[str, tuple[str, Sequence[float]]]


def counted_names(source: Path) -> list[str]:
    """What the program counts, in its order: the first argument of each COUNT in ``main``."""
    return re.findall(r"^    COUNT\((\w+)", source.read_text("utf-8"), re.MULTILINE)


def operands_header(operands: Operands, **constants: int) -> str:
    """C source that defines constants and arrays of operands."""
    lines = [f"#define {name} {value}" for name, value in constants.items()]
    for name, (kind, values) in operands.items():
        shown = ", ".join(
            f"{float(value):.8e}f" if kind == "float" else str(int(value)) for value in values
        )
        lines.append(f"static const {kind} {name}[] = {{{shown}}};")
    return "\n".join(lines) + "\n"


def output_of(*command: str | Path) -> str:
    """What a program prints; raises CalledProcessError, with its words, if it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, check=False)
    if done.returncode:
        sys.stderr.buffer.write(done.stdout + done.stderr)
        done.check_returncode()
    return done.stdout.decode("ascii", "ignore")


def main(part: str, measure: Callable[[Path], CompiledCosts]) -> bool:
    """Count, and show what the data file has beside it; returns whether it was rewritten."""
    parser = argparse.ArgumentParser(description=f"Count the cycles of the {part}'s operations.")
    parser.add_argument("folder", type=Path, help=f"of build_{part}.sh")
    parser.add_argument("--write", action="store_true", help="rewrite the data file")
    args = parser.parse_args()
    found = measure(args.folder.resolve())
    if args.write:
        write_costs(part, found)
    kept = compiled_costs(part)
    print(found.source)
    for name, cycles in {**found.operations, **found.routines}.items():
        before = {**kept.operations, **kept.routines}.get(name, 0)
        print(f"{name:16}{cycles:10.2f}{before:10.2f}")
    return bool(args.write)
