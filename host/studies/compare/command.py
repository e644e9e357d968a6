"""Compare the algorithms that the theses weigh, on the same skies: how many answers are right,
refused and wrong, and what each costs on the device's processor.

identification  triangle, match group, grid, angle, spherical and planar triangle, geometric
                voting, pyramid, and the program of profile extended
attitude        TRIAD, q-method, QUEST, singular values, least squares for nine elements, and
                a Kalman filter over ten images
Methods get directions of stars, so no image is rendered. Results depend on the seed alone.

examples:
  cubestack compare identification
  cubestack compare identification {first} --skies 20 --json
  cubestack compare identification --out docs              the page and its figure
"""

import argparse
import json
from importlib.util import find_spec
from pathlib import Path

from rich.table import Table

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.errors import install_command
from cubestack.host.studies.compare import page, recorded
from cubestack.host.studies.compare.recorded import Job
from cubestack.host.studies.compare.studies import STUDIES
from cubestack.host.studies.compare.study import Row, Rows
from cubestack.host.studies.compare.tracker import tracker, trackers
from cubestack.host.terminal import progress, say, show, tell


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", choices=tuple(STUDIES), help="what is compared")
    parser.add_argument("device", nargs="?", choices=tuple(trackers()), help="default: all")
    usual = ", ".join(f"{one.skies} for {one.name}" for one in STUDIES.values())
    add_value(parser, "skies", whole(None, f"of each case (default: {usual})", 1, metavar="N"))
    add_value(parser, "seed", whole(1, "default 1", 0, metavar="N"))
    add_path(parser, "--out", f"write {page.PAGE} there, or a part of it, and its figure", "FOLDER")
    add_flag(parser, "--stale", "name what has changed since it was stored; with --out, only that")
    add_flag(parser, "--json", "print one JSON object per method and case")


def run(args: argparse.Namespace) -> int:
    """Measure and print; raises ValueError for a folder without a place for the results."""
    names = [args.device] if args.device else list(trackers())
    study = STUDIES[args.study]
    jobs = [Job(study.name, name, args.skies or study.skies, args.seed) for name in names]
    if args.stale:
        reasons = recorded.stale(args.out or Path("docs"), jobs)
        jobs = [job for job in jobs if job in reasons]
        for job in jobs:
            tell(f"{job.key}: {reasons[job]}")
        if not args.out:
            return 1 if jobs else 0
    if args.out:
        if find_spec("matplotlib") is None:
            raise ValueError(f"--out: figures need matplotlib: {install_command('plots')}")
        page.check(args.out)
        for _ in progress(recorded.renewed(args.out, jobs, 1), len(jobs), "comparing"):
            pass
        say(f"wrote {page.write(args.out, args.study)} files to {args.out}")
        return 0
    rows, found = [], (row for job in jobs for row in recorded.perform(job))
    for row in progress(found, study.rows * len(jobs), "comparing", quiet=args.json):
        rows.append(row)
        if args.json:
            print(json.dumps(row.as_dict()), flush=True)
    if not args.json:
        for name in names:
            _show(args.study, name, [row for row in rows if row.device == name])
    return 0


def _show(name: str, device: str, rows: list[Row]) -> None:
    study, found = STUDIES[name], Rows(rows)
    for each in study.tables:
        shown = Table("method", *each.columns, title=f"{tracker(device).title}: {each.title}")
        for method in study.methods:
            shown.add_row(method, *(cell(found, method) for cell in each.columns.values()))
        show(shown)
