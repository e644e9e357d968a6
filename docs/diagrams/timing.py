"""Timing diagrams as SVG: levels and values over time, a lane each."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import pairwise
from typing import NamedTuple

from docs.diagrams.style import head

LANE, HIGH, LEFT, WIDTH, TOP = 34, 18, 150, 840, 34
"""Pixels: height of a lane and of a level in it, names, time axis, and above the lanes."""

CHARACTER = 8
"""Pixels of a character of a value, at least."""

PS_PER = {"s": 10**12, "ms": 10**9, "us": 10**6, "ns": 10**3}

SHAPES = (
    "text{font-size:14px}.name{text-anchor:end;font-family:monospace}"
    ".value{text-anchor:middle;font-size:13px}.axis{text-anchor:middle;font-size:13px}"
    ".wave{fill:none;stroke-width:1.4}"
)


class Lane(NamedTuple):
    """A line of the diagram.

    Attributes:
        name: at its left.
        changes: time in ps and what is from then on, by time; the first one counts from the
            beginning. Levels are 0 and 1; texts are drawn as values, an empty one as nothing.
    """

    name: str
    changes: Sequence[tuple[int, int | str]]


def levels(name: str, changes: Iterable[tuple[int, int]]) -> Lane:
    """A pin."""
    return Lane(name, list(changes))


def values(
    name: str, changes: Iterable[tuple[int, object]], words: Mapping[str, str] | None = None
) -> Lane:
    """A bus or a variable; ``words`` replaces texts."""
    texts = ((time, str(value)) for time, value in changes)
    return Lane(name, [(time, (words or {}).get(text, text)) for time, text in texts])


def timing(lanes: Sequence[Lane], start_ps: int, end_ps: int, unit: str, step: float) -> str:
    """The diagram from ``start_ps``, which its axis calls 0, to ``end_ps``.

    ``unit`` is the axis', s, ms, us or ns, and ``step`` how many of it are between two marks.
    ValueError when there is no time to show.
    """
    if start_ps >= end_ps or step <= 0:
        raise ValueError(f"nothing to show from {start_ps} to {end_ps} ps in steps of {step}")
    scale = WIDTH / (end_ps - start_ps)
    height = TOP + LANE * len(lanes) + 10
    parts = head(LEFT + WIDTH + 20, height, SHAPES)
    marks = int((end_ps - start_ps) / (step * PS_PER[unit])) + 1
    for mark in range(marks):
        x = LEFT + mark * step * PS_PER[unit] * scale
        label = f"{mark * step:g}" + (f" {unit}" if mark == marks - 1 else "")
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP - 8}V{height - 6}"/>')
        parts.append(f'<text class="axis soft" x="{x:.1f}" y="{TOP - 14}">{label}</text>')
    for number, lane in enumerate(lanes):
        bottom = TOP + LANE * number + (LANE + HIGH) / 2
        parts.append(
            f'<text class="name" x="{LEFT - 10}" y="{bottom - 5:.1f}">{escape(lane.name)}</text>'
        )
        shown = _within(lane.changes, start_ps, end_ps)
        at = [(LEFT + (time - start_ps) * scale, what) for time, what in shown]
        parts += _drawn([*at, (LEFT + WIDTH, "")], bottom)
    return "\n".join([*parts, "</svg>", ""])


def _within(
    changes: Sequence[tuple[int, int | str]], start_ps: int, end_ps: int
) -> list[tuple[int, int | str]]:
    """What is at the start, and the changes after it."""
    before = [what for time, what in changes if time <= start_ps]
    first = before[-1] if before else changes[0][1] if changes else ""
    return [(start_ps, first), *(one for one in changes if start_ps < one[0] < end_ps)]


def _drawn(at: Sequence[tuple[float, int | str]], bottom: float) -> list[str]:
    """A lane: a wave of levels, or a box for each value."""
    if not isinstance(at[0][1], str):
        y = [bottom - HIGH * bool(what) for _, what in at[:-1]]
        points = f"M{at[0][0]:.1f} {y[0]:.1f}" + "".join(
            f"H{x:.1f}V{level:.1f}" for (x, _), level in zip(at[1:-1], y[1:], strict=True)
        )
        return [f'<path class="wave" d="{points}H{at[-1][0]:.1f}"/>']
    parts = []
    for (x, what), (end, _) in pairwise(at):
        if what == "":
            continue
        parts.append(
            f'<rect class="box" x="{x:.1f}" y="{bottom - HIGH:.1f}" width="{end - x:.1f}" '
            f'height="{HIGH}" rx="2"/>'
        )
        text = str(what)
        if len(text) * CHARACTER <= end - x:
            middle = (x + end) / 2
            parts.append(
                f'<text class="value" x="{middle:.1f}" y="{bottom - 5:.1f}">{escape(text)}</text>'
            )
    return parts
