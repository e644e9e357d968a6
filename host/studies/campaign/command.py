"""Measure thousands of skies: every combination of the values in a plan, on all cores
or a cluster, with 95 % limits of the rates of right, refused and wrong results.

A plan is a TOML file (docs/how-to/campaigns.md). Results are appended to FOLDER/rows.jsonl block
by block, so an interruption loses little; --resume continues.

examples:
  cubestack campaign --list                               plans shipped with the devices
  cubestack campaign NAME --workers 2                     one of them
  cubestack campaign false-stars.toml
  cubestack campaign false-stars.toml --resume --workers 2
  cubestack campaign false-stars.toml --scheduler tcp://10.0.0.1:8786
  cubestack campaign report false-stars.campaign          report.html there
  cubestack campaign report NEW --compare OLD             exit status 1 if NEW is worse
  cubestack campaign replay false-stars.campaign 17       measure row 17 again
  cubestack campaign parquet false-stars.campaign         rows.parquet there
"""

import argparse
import json
from pathlib import Path

from rich.table import Table

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.campaign import report, statistics
from cubestack.host.studies.campaign.folder import (
    Folder,
    count,
    default_folder,
    replayed,
    write_parquet,
)
from cubestack.host.studies.campaign.folder import run as run_into
from cubestack.host.studies.campaign.plan import CampaignPlan, known_plans, plan_file, summary
from cubestack.host.studies.campaign.report import worst
from cubestack.host.studies.campaign.statistics import Change, compared
from cubestack.host.studies.workers import cores
from cubestack.host.terminal import progress, say, show

REPLAY, REPORT, PARQUET = "replay", "report", "parquet"
WORST = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.usage = (
        "cubestack campaign PLAN [--out FOLDER] [--resume] [--workers N | --scheduler ADDRESS]\n"
        "       cubestack campaign report FOLDER [--compare FOLDER]\n"
        "       cubestack campaign replay FOLDER ROW\n"
        "       cubestack campaign parquet FOLDER"
    )
    parser.add_argument(
        "words", nargs="*", metavar="PLAN", help="file, or name of a plan shipped with a device"
    )
    add_flag(parser, "--list", "list the plans shipped with the devices")
    add_path(parser, "--out", "default: the plan's name, with .campaign", "FOLDER")
    add_flag(parser, "--resume", "continue with the rows in the folder")
    where = parser.add_mutually_exclusive_group()
    add_value(
        where, "workers", whole(None, "processes (default: one for each core)", 1, metavar="N")
    )
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster")
    add_path(parser, "--compare", "for report: an earlier campaign of the same skies", "FOLDER")
    add_value(
        parser,
        "worst",
        whole(
            WORST,
            f"for report: number of worst cases measured again and shown (default {WORST})",
            0,
            metavar="N",
        ),
    )
    add_flag(parser, "--json", "print one JSON object per point")


def run(args: argparse.Namespace) -> int:
    """Run or replay; returns 1 if frames failed or it was stopped."""
    if args.list:
        return _list(as_json=args.json)
    if not args.words:
        raise ValueError("name a plan: a file, or one of --list")
    if args.words[0] == REPLAY:
        return _replay(args.words[1:])
    if args.words[0] == REPORT:
        return _report(args)
    if args.words[0] == PARQUET:
        return _parquet(args.words[1:])
    if args.compare:
        raise ValueError("--compare is for a report")
    if len(args.words) > 1:
        raise ValueError(f"one plan at a time, not {' '.join(args.words)}")
    path = plan_file(args.words[0])
    plan = CampaignPlan.read(path)
    folder = Folder.begun(args.out or default_folder(path), plan, resume=args.resume)
    total, done = count(plan), 0
    before = sum(1 for _ in folder.rows())
    rows = run_into(folder, args.workers or cores(), args.scheduler)
    try:
        for _ in progress(rows, total, "measuring", quiet=args.json, before=before):
            done += 1
    except (KeyboardInterrupt, OSError):
        say(f"{done} of {total} results are in {folder.path}; --resume continues")
        raise
    failed = _show(folder, as_json=args.json)
    return 1 if failed else 0


def _list(*, as_json: bool) -> int:
    for name, path in known_plans().items():
        about = {"plan": name, "what": summary(path)}
        print(json.dumps(about) if as_json else f"{name:<26} {about['what']}")
    return 0


def _replay(words: list[str]) -> int:
    if len(words) != 2 or not words[1].isdecimal():
        raise ValueError("replay wants a campaign's folder and the number of a row")
    print(json.dumps(replayed(Folder(Path(words[0])), int(words[1]))))
    return 0


def _parquet(words: list[str]) -> int:
    if len(words) != 1:
        raise ValueError("parquet wants a campaign's folder")
    say(f"wrote {write_parquet(Folder(Path(words[0])))}")
    return 0


def _report(args: argparse.Namespace) -> int:
    if len(args.words) != 2:
        raise ValueError("report wants a campaign's folder")
    folder, changes = Folder(Path(args.words[1])), list[Change]()
    if args.compare:
        changes = compared(Folder(args.compare), folder)
    cases = list(progress(worst(folder, args.worst), args.worst, "looking", quiet=args.json))
    page, *pictures = report.write(folder, changes, args.compare, cases)
    worse = [change for change in changes if change.worse]
    for change in changes if args.json else worse:
        told = f"{statistics.told(change.point)}: {change.outcome} {change.before} before"
        text = f"{told}, {change.after} after: {report.verdict(change)}"
        print(json.dumps(vars(change)) if args.json else text)
    say(f"wrote {page} and {len(pictures)} figures")
    return 1 if worse else 0


def _show(folder: Folder, *, as_json: bool) -> int:
    """Print the rates at every point; returns the number of failed frames."""
    found = statistics.rates(folder)
    names = list(folder.plan.grid)
    table = Table(*names, *statistics.ENDINGS, title="results, and 95 % limits of their rates")
    for point, ended in found.items():
        of = ended.total()
        if as_json:
            print(json.dumps({"point": dict(point), "of": of, **ended}))
            continue
        cells = []
        for ending in statistics.ENDINGS:
            low, high = (100 * limit for limit in wilson(ended[ending], of))
            cells.append(f"{ended[ending]}\n{low:.1f}-{high:.1f} %")
        table.add_row(*(str(value) for _, value in point), *cells)
    if not as_json:
        show(table)
    failed = sum(ended["failed"] for ended in found.values())
    if failed:
        say(f'{failed} failed: "outcome": "failed" in {folder.path}; replay shows how')
    return failed
