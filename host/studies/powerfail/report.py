"""The folder of a run: its rows, and a page with the flash over time and all findings."""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from html import escape
from importlib.metadata import version
from pathlib import Path

from cubestack.firmware_model.versions import POWERFAIL_ROWS
from cubestack.host.output import output_folder, write_outputs
from cubestack.host.studies.campaign.report import STYLE, html_table
from cubestack.host.studies.powerfail.cases import KINDS
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.picture import flash_picture
from cubestack.host.studies.powerfail.rig import Setup
from cubestack.host.studies.powerfail.scenario import Answers
from cubestack.host.studies.powerfail.trial import MEANINGS, Row

ROWS, PAGE = "rows.jsonl", "report.html"

MOST_LISTED = 200
"""Findings on the page; all are in the rows."""


def open_folder(path: Path, *, force: bool) -> Path:
    """Create a folder for a run; ValueError if it has one already and is not to be replaced."""
    if any((path / name).exists() for name in (ROWS, PAGE)) and not force:
        raise ValueError(f"{path} has results; choose another --out, or replace them with --force")
    return output_folder(path)


def order(rows: Iterable[Row]) -> list[Row]:
    """By the numbers of the cases."""
    return sorted(rows, key=lambda row: tuple(map(int, row.case.split("."))))


def line(row: Row) -> str:
    """A row as a line of JSON."""
    return json.dumps({"version": POWERFAIL_ROWS.current} | asdict(row))


def write(folder: Path, setup: Setup, course: Course, rows: Sequence[Row]) -> Path:
    """Write rows and page; returns the page."""
    lines = "".join(line(row) + "\n" for row in rows)
    write_outputs(folder, {ROWS: lines, PAGE: _page(setup, course, rows)})
    return folder / PAGE


def summary(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Head and lines of a table: verdicts by kind of case."""
    known = [verdict for verdict in MEANINGS if any(row.verdict == verdict for row in rows)]
    counted = {(kind, second): Counter[str]() for kind in KINDS for second in (False, True)}
    for row in rows:
        counted[row.kind, row.second][row.verdict] += 1
    lines = [
        [
            f"{kind}, then a second cut" if second else kind,
            str(ended.total()),
            *(str(ended[verdict]) for verdict in known),
        ]
        for (kind, second), ended in counted.items()
        if ended
    ]
    return ["cut", "cases", *known], lines


def findings(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if not row.right]


def told(row: Row) -> str:
    """A finding in one line."""
    what = "erasure of" if row.erases else "word"
    place = f"{what} {row.address:#010x}" if row.address >= 0 else "the end"
    share = "" if row.share is None else f", {row.share:.0%} done"
    kind = "in the recovery" if row.second else row.kind
    parts = [f"case {row.case}: {row.verdict}", f"{kind}, {place}{share}", row.detail, row.where]
    return "; ".join(filter(None, parts))


def _page(setup: Setup, course: Course, rows: Sequence[Row]) -> str:
    bad, scenario = findings(rows), setup.scenario
    name = Path(setup.image.partition("#")[0]).name
    title = f"{name}: {len(bad)} of {len(rows)} power cuts are not survived"
    parts = [
        "<!doctype html>",
        f'<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>',
        f"<style>{STYLE} svg {{ max-width: none }} .wide {{ overflow-x: auto }}</style>",
        f"<h1>{escape(title)}</h1>",
        f"<p>cubestack {escape(version('cubestack'))}, {scenario.device}, seed {scenario.seed}; "
        f"{len(course.operations)} operations of the flash in {course.end_ps / 1e9:.1f} ms.</p>",
        html_table(*summary(rows)),
        "<h2>Flash over time</h2>",
        "<p>From left to right the operations of the run without cuts; a bar is a programmed word, "
        "a light square an erasure. Below, each kind of cut at that operation; a cross marks "
        "findings.</p>",
        f'<div class="wide">{flash_picture(course, rows)}</div>',
        "<h2>Verdicts</h2>",
        html_table(["verdict", "meaning"], [[key, text] for key, text in MEANINGS.items()]),
        f"<h2>{len(bad)} findings</h2>",
    ]
    if bad:
        head = ["case", "verdict", "cut", "time in ms", "done", "answers", "allowed", "", "at"]
        parts.append(html_table(head, [_cells(row) for row in bad[:MOST_LISTED]]))
        parts.append(f"<p>Replay one in gdb: <code>--case {bad[0].case} --gdb 3333</code></p>")
    return "\n".join([*parts, "</html>"]) + "\n"


def _cells(row: Row) -> list[str]:
    share = "" if row.share is None else f"{row.share:.0%}"
    allowed = " or ".join(_shown(one) for one in row.allowed)
    kind = f"{row.kind}, second" if row.second else row.kind
    return [
        *(row.case, row.verdict, kind, f"{1000 * row.time_s:.3f}", share),
        *(_shown(row.answers), allowed, row.detail, row.where),
    ]


def _shown(answers: Answers) -> str:
    return ", ".join("none" if one is None else repr(one) for one in answers)
