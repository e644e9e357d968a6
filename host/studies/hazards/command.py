"""Count right, refused and wrong results in hard skies: for each hazard a sample image
and a curve over its strength.

Every image goes through the whole device; the bands are 95 % limits of the rates.
Results do not depend on the number of workers.

examples:
  cubestack hazards {first} --hazard moon --frames 20
  cubestack hazards --frames 8 --seed 1 --out docs       all, and the page that shows them
  cubestack hazards --frames 8 --seed 1 --stale          name the curves whose code changed
  cubestack hazards {first} --json > points.jsonl
  cubestack hazards --list                                list hazards and their strengths
"""

import argparse
import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import install_command
from cubestack.host.experiments.hazard_options import Asked, known
from cubestack.host.experiments.measure import experiment_of
from cubestack.host.experiments.opener import Opener
from cubestack.host.experiments.rates import wilson
from cubestack.host.experiments.scene_truth import cameras_of
from cubestack.host.output import write_output
from cubestack.host.pictures.figures import save_curves
from cubestack.host.pictures.images import save_sample
from cubestack.host.studies.hazards import curves, recorded
from cubestack.host.studies.hazards.curves import Point
from cubestack.host.studies.workers import cores
from cubestack.host.terminal import progress, say, show, tell


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
    add_flag(parser, "--stale", "name curves whose code changed since; with --out, only those")
    add_flag(parser, "--json", "print one JSON object per point")


def run(args: argparse.Namespace) -> int:
    """Measure and print; raises ValueError for unknown devices and hazards."""
    if args.list:
        _list()
        return 0
    names = curves.devices_with_hazards() if args.device is None else [args.device]
    jobs = [
        job
        for name in names
        for job in curves.jobs_of(name, args.hazard, args.frames, args.seed, args.profile)
    ]
    if args.out:
        check_page(args.out)
    every = recorded.curves_of(jobs)
    if args.stale:
        reasons = recorded.stale(args.out or Path("docs"), every)
        every = list(reasons)
        for curve, reason in reasons.items():
            tell(f"{recorded.key(curve[0])}: {reason}")
        if not (args.out and every):
            return 1 if every else 0
        jobs = [job for curve in every for job in curve]
    workers = min(args.workers or cores(), len(jobs))
    points = []
    found = recorded.renewed(args.out, every, workers) if args.out else curves.run(jobs, workers)
    for point in progress(found, len(jobs), "measuring", quiet=args.json):
        points.append(point)
        if args.json:
            print(json.dumps(point.as_dict()), flush=True)
    if not args.json:
        _show(points)
    if args.out:
        written = write_page(points, args.out, args.seed)
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


PROFILE = "extended"
PAGE = "hazards.md"
PICTURES = Path("images") / "hazards"
BEGIN, END = "<!-- hazards -->\n", "<!-- end of hazards -->\n"
TITLE = f"# Hard skies\n\n{BEGIN}{END}"


def check_page(folder: Path) -> None:
    """Create the folder; raises ValueError if it, its figures or its page cannot be written."""
    if find_spec("matplotlib") is None:
        raise ValueError(f"--out: figures need matplotlib: {install_command('plots')}")
    try:
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ValueError(f"--out: {folder} is a file; a folder would be right") from None
    _page(folder)


def write_page(points: Sequence[Point], folder: Path, seed: int) -> int:
    """Write images, curves, points and the page; returns the number of files.

    Earlier points of other curves remain.
    """
    pictures = folder / PICTURES
    names = {point.hazard for point in points}
    points = _merged(points, pictures / "points.jsonl")
    lines = [json.dumps(point.as_dict()) for point in points]
    write_output(pictures / "points.jsonl", "\n".join(lines) + "\n")
    for name in sorted(names):
        own = [point for point in points if point.hazard == name]
        save_curves(
            {registered(device).title: of for device, of in _by_device(own).items()},
            _axis(name),
            known()[name].meaning,
            wilson,
            pictures / f"{name}-curve.png",
        )
        for device in _by_device(own):
            save_sample(sample(device, name, seed), pictures / f"{name}-{device}.jpg")
    before, after = _page(folder)
    every = sorted({point.hazard for point in points})
    sections = [_section(name, [p for p in points if p.hazard == name]) for name in every]
    write_output(folder / PAGE, before + BEGIN + "\n".join(sections) + END + after)
    return 2 + len(names) + len({(p.hazard, p.device) for p in points if p.hazard in names})


def _merged(points: Sequence[Point], file: Path) -> list[Point]:
    """The points, and those of other curves in a file; in the order of devices and hazards."""
    measured = {(point.device, point.hazard) for point in points}
    lines = file.read_text("utf-8").splitlines() if file.is_file() else []
    stored = [Point(**json.loads(line)) for line in lines]
    every = [*points, *(one for one in stored if (one.device, one.hazard) not in measured)]
    order = curves.devices_with_hazards()
    return sorted(every, key=lambda one: (order.index(one.device), one.hazard))


def _page(folder: Path) -> tuple[str, str]:
    """The page's text before and after the hazards; raises ValueError without the markers."""
    path = folder / PAGE
    page = path.read_text("utf-8") if path.is_file() else TITLE
    if BEGIN not in page or END not in page:
        raise ValueError(f"--out: {path} has no lines {BEGIN.strip()} and {END.strip()}")
    return page.split(BEGIN)[0], page.split(END, 1)[1]


def _by_device(points: Sequence[Point]) -> dict[str, list[Point]]:
    found: dict[str, list[Point]] = {}
    for point in points:
        found.setdefault(point.device, []).append(point)
    return found


def _axis(name: str) -> str:
    scale = known()[name].strength
    return f"{scale.key}, {scale.unit}" if scale.unit else scale.key


def _section(name: str, points: Sequence[Point]) -> str:
    """A section of the page: the hazard, an image per device, the curve and the numbers."""
    kind = known()[name]
    usual, where = f"{kind.strength.usual:g}", "/".join(kind.__module__.split(".")[1:])
    lines = [
        f"## {name}",
        "",
        f"{kind.meaning[0].upper()}{kind.meaning[1:]}: `--hazard {name}`, which is "
        f"`{name}={usual}`. Source: `{where}.py`.",
        "",
    ]
    for device in _by_device(points):
        title = f"{registered(device).title}, {_axis(name)} {usual}"
        lines += [f"![{title}]({PICTURES.as_posix()}/{name}-{device}.jpg)", ""]
    lines += [f"![right, refused and wrong]({PICTURES.as_posix()}/{name}-curve.png)", ""]
    lines += [f"| | {_axis(name)} | right | refused | wrong |", "|-|-|-|-|-|"]
    for device, own in _by_device(points).items():
        for point in own:
            reasons = ", ".join(f"{count} {reason}" for reason, count in point.reasons.items())
            refused = f"{point.refused} ({reasons})" if reasons else f"{point.refused}"
            lines.append(
                f"| {registered(device).title} | {point.strength:g} | {point.right} of "
                f"{point.pictures} | {refused} | {point.wrong} |"
            )
    return "\n".join(lines) + "\n"


def sample(device: str, hazard: str, seed: int) -> NDArray[np.uint8]:
    """The image (rows, columns) of a device's first frame with a hazard of its usual strength;
    several cameras side by side.
    """
    found, kept = registered(device), list[AnyEmulated]()
    options = experiment_of(found).options(hazard=(Asked(hazard),), seed=seed)
    opener = Opener(found, board={"profile": PROFILE}, opened=kept.append)
    pictures: list[NDArray[np.uint8]] = []
    results = experiment_of(found).run(opener, options)
    # Each result is the next camera's; the rendered image equals a download.
    for _ in results:
        cameras = list(cameras_of(kept[0].board))
        pictures.append(cameras[len(pictures)].rendered)
        if len(pictures) == len(cameras):
            break
    return np.hstack(pictures)
