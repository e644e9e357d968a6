"""Cut the power at every change of the flash, and check what the program remembers.

A scenario sends commands to the device and says, or lets the run learn, what it must remember after
each. The run cuts the supply before, in the middle of and after every word write and page erasure,
cuts it again while the program recovers, wears cells out, and lets the supply dip. After each the
device must start, answer, remember the state before or after the command, and go on.
docs/how-to/powerfail.md explains the scenario.

examples:
  cubestack powerfail program.elf --scenario settings.toml
  cubestack powerfail program.elf --scenario settings.toml --case 12 --gdb 3333
"""

import argparse
from pathlib import Path

from rich.table import Table

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_output, add_value
from cubestack.host.studies.powerfail import report
from cubestack.host.studies.powerfail.cases import cases_of
from cubestack.host.studies.powerfail.course import Course, learn
from cubestack.host.studies.powerfail.replay import Gdb, Witness, replay
from cubestack.host.studies.powerfail.report import ROWS
from cubestack.host.studies.powerfail.rig import Setup, marked
from cubestack.host.studies.powerfail.run import fresh_rig
from cubestack.host.studies.powerfail.run import run as run_cases
from cubestack.host.studies.powerfail.scenario import Scenario
from cubestack.host.studies.powerfail.trial import Row
from cubestack.host.studies.workers import cores
from cubestack.host.terminal import progress, say, show, tell

SUFFIX = ".powerfail"

SHOWN = 10
"""Findings that are printed; the page has more."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("image", metavar="IMAGE", help="program, as for --firmware of emulate")
    parser.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        required=True,
        help="TOML file: commands, questions",
    )
    add_output(
        parser, "--out", f"folder of the results (default: IMAGE{SUFFIX})", "FOLDER", inside=ROWS
    )
    where = parser.add_mutually_exclusive_group()
    add_value(
        where, "workers", whole(None, "processes (default: one for each core)", 1, metavar="N")
    )
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster")
    parser.add_argument(
        "--case", metavar="N", help="run only this case; N.M is its second cut number M"
    )
    add_value(parser, "gdb", whole(None, "with --case: serve gdb there", 0, 65535, metavar="PORT"))
    add_flag(parser, "--json", "print one JSON object per case")


def run(args: argparse.Namespace) -> int:
    """Run or replay; returns 1 if there are findings."""
    if args.gdb is not None and args.case is None:
        raise ValueError("--gdb needs --case")
    scenario = Scenario.read(args.scenario)
    setup = Setup(marked(args.image, scenario), scenario)
    course = learn(setup, fresh_rig(setup))
    if args.case is not None:
        return _replay(setup, course, args)
    name = Path(args.image.partition("#")[0]).name
    folder = report.open_folder(args.out or Path(f"{name}{SUFFIX}"), force=args.force)
    cases = cases_of(setup.scenario, course)
    rows = list[Row]()
    tried = run_cases(setup, course, cases, args.workers or cores(), args.scheduler)
    for group in progress(tried, len(cases), "cutting", quiet=args.json):
        rows += group
    rows = report.order(rows)
    page = report.write(folder, setup, course, rows)
    _show(rows, as_json=args.json)
    say(f"wrote {page}")
    return 1 if report.findings(rows) else 0


def _replay(setup: Setup, course: Course, args: argparse.Namespace) -> int:
    witness = Witness() if args.gdb is None else Gdb(args.gdb, say)
    row = replay(setup, course, args.case, witness)
    tell(report.line(row) if args.json else report.told(row))
    return 0 if row.right else 1


def _show(rows: list[Row], *, as_json: bool) -> None:
    if as_json:
        for row in rows:
            print(report.line(row))
        return
    head, lines = report.summary(rows)
    table = Table(*head)
    for line in lines:
        table.add_row(*line)
    show(table)
    bad = report.findings(rows)
    for row in bad[:SHOWN]:
        tell(report.told(row))
    if len(bad) > SHOWN:
        tell(f"and {len(bad) - SHOWN} more")
