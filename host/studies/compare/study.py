"""What both comparisons have: rows of figures, verdicts of the theses, and tables of the page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any

from cubestack.host.studies.compare.tracker import Tracker


@dataclass(frozen=True)
class Row:
    """A method on the skies of a case; attributes are those of the JSON output."""

    device: str
    method: str
    case: str
    figures: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        named: dict[str, Any] = {"device": self.device, "method": self.method, "case": self.case}
        return named | dict(self.figures)


class Rows:
    """Rows of one tracker."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._figures = {(row.method, row.case): row.figures for row in rows}

    def __call__(self, method: str, case: str, figure: str) -> float:
        return self._figures[method, case][figure]


@dataclass(frozen=True)
class Verdict:
    """A statement of a thesis that the figures of a tracker can confirm or not."""

    statement: str  #: in our words
    source: str
    holds: Callable[[Rows, Tracker], bool]


Cell = Callable[[Rows, str], str]
"""A cell of a table, of a tracker's rows and a method's name."""


def number(figure: str, case: str, form: str, unit: float = 1.0) -> Cell:
    """A figure of a case in a unit; a dash if it is not known."""

    def cell(rows: Rows, method: str) -> str:
        value = rows(method, case, figure)
        return "-" if isnan(value) else format(value / unit, form)

    return cell


@dataclass(frozen=True)
class Table:
    """A table of the page: a line per method, a column per figure or case."""

    title: str
    columns: Mapping[str, Cell]  #: by heading


@dataclass(frozen=True)
class Study:
    """A comparison; module ``run`` beside it has a function ``run`` that yields its rows."""

    name: str
    skies: int  #: of each case, by default
    rows: int  #: how many there are of a tracker
    methods: Mapping[str, str]  #: sections that describe each, by name
    tables: Sequence[Table]
    verdicts: Sequence[Verdict]
    plot: Callable[[Mapping[str, Rows]], bytes]  #: a PNG of the trackers' rows by title


def tables(study: Study, title: str, rows: Rows) -> str:
    """Markdown of a tracker's tables."""
    parts = []
    for table in study.tables:
        heads = ["method", "source", *table.columns]
        lines = [f"**{title}: {table.title}**", "", f"| {' | '.join(heads)} |"]
        lines.append("|-" * len(heads) + "|")
        for name, source in study.methods.items():
            cells = [name, source, *(cell(rows, name) for cell in table.columns.values())]
            lines.append(f"| {' | '.join(cells)} |")
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def verdicts(study: Study, found: Mapping[str, tuple[Tracker, Rows]]) -> str:
    """Markdown of the theses' statements beside what the trackers' figures say."""
    heads = ["the thesis says", "section", *(tracker.title for tracker, _ in found.values())]
    lines = [f"| {' | '.join(heads)} |", "|-" * len(heads) + "|"]
    for one in study.verdicts:
        words = (
            "holds" if one.holds(rows, tracker) else "**does not hold**"
            for tracker, rows in found.values()
        )
        lines.append(f"| {one.statement} | {one.source} | {' | '.join(words)} |")
    return "\n".join(lines) + "\n"
