"""Measure every published figure of the devices: the documents' values, ours in both
profiles, and how ours arise.

  predicted   follows from the model; nothing was set to match it
  fitted      a constant was set to match it
  chosen      depends on a choice that the document leaves open
  definition  the document's own formula or setting

The documentation stores what was measured in docs/data, with the code that it depends
on; --write renews it, and the tables of the pages. All rows take less than twenty
minutes on two idle cores.

examples:
  cubestack fidelity --quick
  cubestack fidelity {second} --rows 'sun-*'
  cubestack fidelity --stale                 name the rows whose code has changed
  cubestack fidelity --stale --write         measure those again
"""

import argparse
import json
import time
from pathlib import Path

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_value
from cubestack.host.devices.registry import devices
from cubestack.host.output import write_output
from cubestack.host.studies.fidelity import recorded, text
from cubestack.host.studies.fidelity import table as fidelity
from cubestack.host.studies.workers import cores
from cubestack.host.terminal import busy, say, tell


def add_arguments(parser: argparse.ArgumentParser) -> None:
    known = [device.name for device in devices() if "fidelity" in device.studies]
    parser.add_argument("device", nargs="?", choices=known, help="default: all")
    parser.add_argument(
        "--rows",
        action="append",
        default=[],
        metavar="PATTERN",
        help="keys of rows, e.g. 'sun-*'; repeatable",
    )
    parser.add_argument("--profile", choices=PROFILES, help="default: both")
    add_flag(parser, "--quick", "a few pictures of each kind")
    add_value(parser, "frames", whole(None, "pictures of each kind", 1, metavar="N"))
    add_value(
        parser, "workers", whole(None, "processes (default: one for each core)", 1, metavar="N")
    )
    add_flag(parser, "--json", "print one JSON object per row")
    add_flag(parser, "--markdown", "print the tables of the pages")
    add_flag(parser, "--stale", "name rows whose code changed since; with --write, only those")
    parser.add_argument(
        "--write",
        nargs="?",
        const="docs",
        type=Path,
        metavar="FOLDER",
        help="store the measurements and rewrite the tables of the pages there (default docs)",
    )
    parser.set_defaults(known=known)


def run(args: argparse.Namespace) -> int:
    """Measure and print; raises ValueError for unknown rows or pages."""
    if args.write and (args.quick or args.frames):
        raise ValueError("--write measures rows whole: without --quick and --frames")
    names = [args.device] if args.device else args.known
    chosen = {name: fidelity.chosen_rows(name, args.rows) for name in names}
    if not any(chosen.values()):
        raise ValueError(f"no row is like {', '.join(args.rows)}; --quick --json lists all keys")
    profiles = [args.profile] if args.profile else PROFILES
    for name in names if args.write else ():
        _check_pages(args.write, name)
    trials = {name: [row.trial for _, row in rows] for name, rows in chosen.items()}
    if (args.write or args.stale) and not args.rows:  # also those of figures without rows
        trials = {name: list(fidelity.fidelity_of(name).trials) for name in names}
    jobs = [
        job
        for name in names
        for job in fidelity.jobs_of(
            name, trials[name], profiles, quick=args.quick, frames=args.frames
        )
    ]
    if args.stale:
        docs = args.write or Path("docs")
        reasons = recorded.stale(docs, names)
        jobs = [job for job in jobs if job in reasons]
        for job in jobs:
            keys = ", ".join(row.key for row in recorded.rows_of(job))
            of_rows = f" rows {keys}:" if keys else ""
            tell(f"{job.device}, {job.key}:{of_rows} {reasons[job]}")
        if not args.write:
            return 1 if jobs else 0
    if args.write:
        _write(args, jobs, names)
        return 0
    workers = min(args.workers or cores(), len(jobs))
    told = _Rest(jobs, quiet=args.json)
    with busy("measuring", quiet=args.json) as shown:
        found = fidelity.run_jobs(jobs, workers, lambda job: shown(told(job), len(jobs)))
    for name, rows in chosen.items():
        _show(args, list(fidelity.filled(name, rows, found)))
    return 0


def _write(args: argparse.Namespace, jobs: list[fidelity.Job], names: list[str]) -> None:
    """Renew the jobs' measurements, then the pages' tables and the figures in their text."""
    if jobs:
        told = _Rest(jobs, quiet=False)
        with busy("measuring") as shown:
            workers = min(args.workers or cores(), len(jobs))
            done = recorded.renewed(
                args.write, jobs, workers, lambda job: shown(told(job), len(jobs))
            )
            for difference in done:
                say(difference)
    for name in names:
        for path, page in recorded.pages(args.write, name).items():
            write_output(path, page)
            say(f"wrote the rows of {name} in {path}")
    stored = text.stored_in(args.write)
    for path in text.pages_with_figures(args.write):
        write_output(path, text.filled(path, stored))


class _Rest:
    """Progress with an estimate of the remaining time."""

    def __init__(self, jobs: list[fidelity.Job], *, quiet: bool) -> None:
        self.all_s = self.rest_s = sum(job.seconds for job in jobs)
        self.count, self.done, self.quiet = len(jobs), 0, quiet
        self.started = time.monotonic()

    def __call__(self, job: fidelity.Job) -> int:
        self.done += 1
        self.rest_s -= job.seconds
        if not self.quiet:
            took_s = time.monotonic() - self.started
            rest_s = took_s * self.rest_s / max(self.all_s - self.rest_s, 1e-9)
            say(
                f"{self.done}/{self.count} {job.device} {job.trial}, {job.profile}: "
                f"{took_s:.0f} s, about {rest_s:.0f} s to go"
            )
        return self.done


def _check_pages(folder: Path, name: str) -> None:
    """Raises ValueError if a table of a device has no place in its page."""
    declared = fidelity.fidelity_of(name)
    for table in declared.tables:
        path: Path = folder / declared.page_of(table)
        page = path.read_text("utf-8") if path.is_file() else ""
        if not all(mark in page for mark in fidelity.marks(table)):
            raise ValueError(f"{path} has no {fidelity.marks(table)[0].strip()}, or is not there")


def _show(args: argparse.Namespace, rows: list[fidelity.Measured]) -> None:
    if args.json:
        for row in rows:
            print(json.dumps(row.as_dict()), flush=True)
    elif args.markdown:
        for table in dict.fromkeys(row.table for row in rows):
            print(f"{table}\n\n{fidelity.markdown([row for row in rows if row.table == table])}")
    else:
        for row in rows:
            ours = "; ".join(f"{profile} {value}" for profile, value in row.ours.items())
            tell(f"{row.key}: {row.figure} ({row.source})")
            tell(f"    document {row.published}; {ours}; {row.word}")
