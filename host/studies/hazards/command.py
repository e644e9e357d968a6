"""Count right, refused and wrong results in hard skies: for each hazard a sample image
and a curve over its strength.

Every image goes through the whole device; the bands are 95 % limits of the rates.
Results do not depend on the number of workers.

examples:
  cubestack hazards {first} --hazard moon --frames 20
  cubestack hazards --frames 40 --out docs                all, and the page that shows them
  cubestack hazards {first} --json > points.jsonl
  cubestack hazards --list                                list hazards and their strengths
"""

import argparse
import json

from rich.table import Table

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.experiments.hazard_options import known
from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.hazards import album, curves
from cubestack.host.studies.workers import cores
from cubestack.host.terminal import progress, say, show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("device", nargs="?", help="default: all devices with hazards")
    parser.add_argument(
        "--hazard", action="append", default=[], metavar="NAME", help="default: all; may be given "
        "again",
    )  # fmt: skip
    add_flag(parser, "--list", "list hazards and their strengths")
    add_value(parser, "frames", whole(20, "of each strength (default 20)", 1, metavar="N"))
    add_value(parser, "seed", whole(0, "default 0", 0, metavar="N"))
    parser.add_argument("--profile", choices=PROFILES, default="extended", help="default: extended")
    add_value(
        parser, "workers", whole(None, "processes (default: one for each core)", 1, metavar="N")
    )
    add_path(
        parser,
        "--out",
        "write hazards.md there, or a part of it, with pictures, curves and points",
        "FOLDER",
    )
    add_flag(parser, "--json", "print one JSON object per point")


def run(args: argparse.Namespace) -> int:
    """Measure and print; raises ValueError for unknown devices and hazards."""
    if args.list:
        _list()
        return 0
    names = [args.device] if args.device else curves.devices_with_hazards()
    jobs = [
        job
        for name in names
        for job in curves.jobs_of(name, args.hazard, args.frames, args.seed, args.profile)
    ]
    if args.out:
        album.check(args.out)
    workers = min(args.workers or cores(), len(jobs))
    points = []
    for point in progress(curves.run(jobs, workers), len(jobs), "measuring", quiet=args.json):
        points.append(point)
        if args.json:
            print(json.dumps(point.as_dict()), flush=True)
    if not args.json:
        _show(points)
    if args.out:
        written = album.write(points, args.out, args.seed)
        say(f"wrote {written} files to {args.out}")
    return 0


def _list() -> None:
    table = Table("hazard", "what it is", "strength")
    for name, kind in sorted(known().items()):
        values = ", ".join(f"{value:g}" for value in kind.strength.values)
        table.add_row(name, kind.meaning, f"{kind.strength.key}: {values} {kind.strength.unit}")
    show(table)


def _show(points: list[curves.Point]) -> None:
    table = Table(title="pictures right, refused and wrong; 95 % limits in brackets")
    for column in ("device", "hazard", "strength", "right", "refused", "wrong", "reasons"):
        table.add_column(column, overflow="fold")
    for point in points:
        right, wrong = (
            "{} ({:.0f}-{:.0f} %)".format(
                count, *(100 * limit for limit in wilson(count, point.pictures))
            )
            for count in (point.right, point.wrong)
        )
        reasons = ", ".join(f"{reason} {count}" for reason, count in point.reasons.items())
        strength = f"{point.strength:g}"
        table.add_row(
            *(point.device, point.hazard, strength, right, str(point.refused), wrong, reasons)
        )
    show(table)
