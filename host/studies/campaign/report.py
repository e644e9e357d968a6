"""A campaign's page: one self-contained HTML file."""

from base64 import b64encode
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path

from cubestack.host.devices.experiment import Section
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.experiments.measure import MEASURE, experiment_of
from cubestack.host.experiments.rates import wilson
from cubestack.host.experiments.scene_truth import picture_of
from cubestack.host.output import write_outputs
from cubestack.host.pictures.figures import error_curves, rate_curves
from cubestack.host.pictures.images import save_sample
from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder, again
from cubestack.host.studies.campaign.statistics import (
    ENDINGS,
    ERROR,
    Change,
    Point,
    errors,
    rates,
    told,
)

ORDER = ("failed", "wrong", "refused", "right")
"""Outcomes, worst first."""


@dataclass(frozen=True)
class Figure:
    """A figure's PNG, and what one sees in it."""

    png: bytes
    caption: str


@dataclass(frozen=True)
class Case:
    """A row with its number in the file, a caption, and the image as JPEG, if any."""

    number: int
    text: str
    jpeg: bytes


def worst(folder: Folder, count: int) -> Iterator[Case]:
    """The worst cases first: by outcome, then by largest error.

    Each needs the run up to its frame. Only `measure` has images.
    """
    if folder.plan.command != MEASURE:
        return
    rows = sorted(enumerate(folder.rows()), key=lambda each: _badness(each[1]))
    for number, row in rows[:count]:
        yield Case(number, _told(row), _picture(folder, row))


def _badness(row: Row) -> tuple[int, float]:
    return ORDER.index(row.outcome), -max(_errors(row).values(), default=0.0)


def _errors(row: Row) -> dict[str, float]:
    return {
        name: abs(value)
        for name, value in row.result.items()
        if name.startswith(ERROR) and isinstance(value, int | float)
    }


def _told(row: Row) -> str:
    """Outcome and reason, errors, and the swept options."""
    errors = ", ".join(f"{name} {value:.3g}" for name, value in _errors(row).items())
    swept = ", ".join(f"{name} = {value}" for name, value in row.swept.items())
    return "; ".join(part for part in (row.outcome, row.reason, errors, swept) if part)


def _picture(folder: Folder, row: Row) -> bytes:
    seen = list[AnyEmulated]()
    try:
        again(folder, row, seen.append)
    except Exception:  # it may fail again; images up to then are shown
        if row.outcome != "failed":
            raise
    picture = picture_of(seen[-1].board) if seen else None
    if picture is None:
        return b""
    written = BytesIO()
    save_sample(picture, written)
    return written.getvalue()


PAGE = "report.html"
FAILURES = 20
"""Number of failed frames on the page."""

STYLE = """
body { font: 15px/1.5 sans-serif; color: #111; background: #fff; max-width: 60em; margin: 2em auto;
       padding: 0 1em }
table { border-collapse: collapse } th, td { border: 1px solid #999; padding: .2em .6em;
       text-align: right } th:first-child, td:first-child { text-align: left }
img { max-width: 100% } figure { margin: 0 0 1.5em } code { background: #eee }
.worse { font-weight: bold }
"""


def write(
    folder: Folder,
    changes: Sequence[Change] = (),
    against: Path | None = None,
    cases: Sequence[Case] = (),
) -> list[Path]:
    """Write the page and its figures into the folder; returns the files, page first.

    ``cases`` are shown with their pictures.

    Raises ValueError for a folder without rows, or without matplotlib.
    """
    found = rates(folder)
    if not found:
        raise ValueError(f"{folder.path} has no rows yet")
    pictures = {
        f"rates-{name}.png": Figure(
            _swept(folder, name, found),
            f"How results ended at each value of {name}, over all values of the other options; "
            "bars are 95 % limits.",
        )
        for name, values in folder.plan.grid.items()
        if len(values) > 1
    }
    measured = experiment_of(registered(folder.plan.device), folder.plan.command)
    published = "; vertical lines are published values"
    for name, points in errors(folder).items():
        curves = {told(point): values for point, values in points.items()}
        marks = [(mark.value, mark.text) for mark in measured.marks if mark.error == name]
        pictures[f"{name}.png"] = Figure(
            error_curves(name, curves, marks),
            "Share of the results whose error is smaller, by point of the grid, with the number of "
            f"results; bands are 95 % limits{published if marks else ''}.",
        )
    done = (row.result for row in folder.rows() if row.result)
    sections = list(measured.sections(done))
    pictures |= {
        f"{each.title.replace(' ', '-')}.png": Figure(each.png, "") for each in sections if each.png
    }
    page = _page(folder, found, pictures, sections, changes, against, cases)
    write_outputs(folder.path, {PAGE: page, **{name: one.png for name, one in pictures.items()}})
    return [folder.path / name for name in (PAGE, *pictures)]


def _swept(folder: Folder, name: str, found: Mapping[Point, Counter[str]]) -> bytes:
    """Rates over one swept option, for all values of the others."""
    values = folder.plan.grid[name]
    counted = [Counter[str]() for _ in values]
    for point, ended in found.items():
        value = dict(point)[name]
        counted[values.index(list(value) if isinstance(value, tuple) else value)] += ended
    curves = {
        outcome: [(ended[outcome] / max(ended.total(), 1), *wilson(ended[outcome], ended.total()))
                  for ended in counted]
        for outcome in ENDINGS
        if outcome != "failed" or any(ended[outcome] for ended in counted)
    }  # fmt: skip
    return rate_curves(name, values, curves)


def _page(
    folder: Folder,
    found: Mapping[Point, Counter[str]],
    pictures: Mapping[str, Figure],
    sections: Sequence[Section],
    changes: Sequence[Change],
    against: Path | None,
    cases: Sequence[Case],
) -> str:
    plan = folder.plan
    title = f"{plan.device}: {sum(ended.total() for ended in found.values())} results"
    parts = [
        "<!doctype html>",
        f'<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>',
        f"<style>{STYLE}</style><h1>{escape(title)}</h1>",
        f"<p>cubestack {escape(folder.version)}, seed {plan.seed}; options ",
        f"<code>{escape(str(dict(plan.options)))}</code>; drawn anew for each block "
        f"<code>{escape(str(dict(plan.random)))}</code>. 95 % limits are Wilson's.</p>",
        "<h2>How often</h2>",
        html_table(
            ["", "results", *ENDINGS], [_rates(point, ended) for point, ended in found.items()]
        ),
    ]
    if against is not None:
        parts += [f"<h2>Compared with {escape(str(against))}</h2>", _changes(changes)]
    for section in sections:
        if section.rows:
            parts += [f"<h2>{escape(section.title)}</h2>", html_table(section.head, section.rows)]
    for name, one in pictures.items():
        title = Path(name).stem.replace("_", " ").replace("-", " ")
        parts += [f"<h2>{escape(title)}</h2>", _figure("png", one.png, one.caption or title)]
    if cases:
        parts += [
            "<h2>Worst cases</h2>",
            "<p>Failed, wrong and refused results first, then the largest errors. The images are "
            "what the camera saw, contrast stretched.</p>",
        ]
    for case in cases:
        parts.append(_figure("jpeg", case.jpeg, f"row {case.number}: {case.text}"))
    failed = [(number, row) for number, row in enumerate(folder.rows()) if row.outcome == "failed"]
    if failed:
        lines = [[str(number), row.reason] for number, row in failed[:FAILURES]]
        parts += [f"<h2>{len(failed)} failed</h2>", html_table(["row, for replay", "error"], lines)]
    return "\n".join([*parts, "</html>"]) + "\n"


def _figure(kind: str, image: bytes, caption: str) -> str:
    data = b64encode(image).decode("ascii")
    shown = f'<img alt="{escape(caption)}" src="data:image/{kind};base64,{data}">' if image else ""
    return f"<figure>{shown}<figcaption>{escape(caption)}</figcaption></figure>"


def _rates(point: Point, ended: Counter[str]) -> list[str]:
    of = ended.total()
    cells = [told(point), str(of)]
    for outcome in ENDINGS:
        low, high = (100 * limit for limit in wilson(ended[outcome], of))
        cells.append(f"{ended[outcome]} ({low:.2f} to {high:.2f} %)")
    return cells


def _changes(changes: Sequence[Change]) -> str:
    head = ["", "outcome", "before", "after", "only before", "only after", "by chance", ""]
    return html_table(
        head,
        [
            [
                *(told(each.point), each.outcome, str(each.before), str(each.after)),
                *(str(each.lost), str(each.gained), f"{each.chance:.2g}", verdict(each)),
            ]
            for each in changes
        ],
    )


def verdict(change: Change) -> str:
    return "worse" if change.worse else "better" if change.significant else "no change"


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of texts."""
    lines = ["<table>", "<tr>" + "".join(f"<th>{escape(cell)}</th>" for cell in head) + "</tr>"]
    lines += [
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    ]
    return "\n".join([*lines, "</table>"])
