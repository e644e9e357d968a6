"""Count the cycles of a device's program as compiled code on its simulated processor.

It compiles each operation of the device's cost table, and the processing of a whole image phase
by phase, and counts their cycles. Needs arm-none-eabi-gcc.

examples:
  cubestack costs measure
  cubestack costs measure --level O0 --precision double
  cubestack costs measure --write           rewrite the data file and the table of docs/fidelity.md
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from cubestack.host.cli.arguments import add_flag
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.registry import devices
from cubestack.host.output import write_output
from cubestack.host.terminal import busy, show, tell


@dataclass(frozen=True)
class CostMeasurement:
    """Of one build."""

    #: build, timing: compiler options and precision, and waits of the memories, in words
    build: str
    timing: str
    operations: Mapping[str, float]  #: cycles of each operation by name
    phases: Mapping[str, int]  #: cycles of each phase of the processing


@dataclass(frozen=True)
class CostReport:
    """The cost measurement of a device's program."""

    #: levels, precisions: available builds
    levels: tuple[str, ...]
    precisions: tuple[str, ...]
    #: measures builds of the given levels and precisions
    measure: Callable[[Sequence[str], Sequence[str]], Iterator[CostMeasurement]]
    as_data: Callable[[Sequence[CostMeasurement]], dict[str, Any]]  #: content of ``file``
    file: Path
    page: Callable[[Sequence[CostMeasurement]], str]  #: a table for ``document``, a page of docs
    document: str
    table: Mapping[str, float]  #: cycles that the device's model charges, by name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    known = [device.name for device in devices() if "costs" in device.studies]
    parser.add_argument("action", choices=("measure",), help="compile, run, count")
    parser.add_argument("device", nargs="?", choices=known, default=known[0] if known else None)
    parser.add_argument(
        "--level", action="append", metavar="O2", help="compiler option; repeatable"
    )
    parser.add_argument("--precision", action="append", metavar="KIND", help="repeatable")
    add_flag(parser, "--json", "print one JSON object")
    add_flag(parser, "--write", "rewrite data file and docs")


def run(args: argparse.Namespace) -> int:
    report = _report(args.device)
    levels = _known("--level", args.level, report.levels)
    precisions = _known("--precision", args.precision, report.precisions)
    found = []
    with busy("compiling and counting", quiet=args.json):
        for one in report.measure(levels, precisions):
            found.append(one)
            if not args.json:
                tell(f"{one.build}, {one.timing}: {sum(one.phases.values()):,} cycles")
    if args.write:
        write_output(report.file, json.dumps(report.as_data(found), indent=1) + "\n")
        rewrite_table(Path("docs") / report.document, "costs", report.page(found))
    elif args.json:
        print(json.dumps(report.as_data(found)))
    else:
        _show(report, found)
    return 0


def _report(name: str | None) -> CostReport:
    chosen: AnyDevice | None = next((d for d in devices() if d.name == name), None)
    if chosen is None or "costs" not in chosen.studies:
        raise ValueError("no device has a program to compile")
    report: CostReport = chosen.study("costs")
    return report


def _known(option: str, wanted: list[str] | None, known: tuple[str, ...]) -> tuple[str, ...]:
    for value in wanted or ():
        if value not in known:
            raise ValueError(f"{option} must be one of {', '.join(known)}, not {value}")
    return tuple(wanted or known)


def _show(report: CostReport, found: list[CostMeasurement]) -> None:
    """Operations with a column per build, beside the charged cycles."""
    first = [one for one in found if one.timing == found[0].timing]
    table = Table("operation", "charged", *(one.build for one in first))
    for name, charged in report.table.items():
        if name in first[0].operations:
            table.add_row(name, f"{charged:g}", *(f"{one.operations[name]:g}" for one in first))
    show(table)


def rewrite_table(page: Path, name: str, table: str) -> None:
    """Replace the table between the page's marks of ``name``; ValueError if it has none."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    text = page.read_text("utf-8")
    if begin not in text or end not in text:
        raise ValueError(f"{page} has no {begin.strip()}")
    before, rest = text.split(begin)
    write_output(page, f"{before}{begin}\n{table}\n\n{end}{rest.split(end)[1]}")
