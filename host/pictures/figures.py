"""Figures of rates over what was swept, of distributions of errors and of effects of upsets."""

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from math import log, radians, sin, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cubestack.host.errors import install_command

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_LETTERS = 60
"""Names below an axis that fit beside each other."""

MOST_INSIDE = 4
"""Lines of a legend inside of a panel; a longer one is placed below it."""

LONG_NAME = 40
"""Letters of a line of such a legend that does not fit beside another."""

LEGEND_LINE = 0.17
"""Height of a line of such a legend, in inches."""

LINES = ("-", "--", "-.", ":")
MARKS = {"right": "o", "refused": "s", "wrong": "x", "failed": "^"}
COLOURS = {"right": "#1a7f37", "refused": "#9a9a9a", "wrong": "#c62828", "failed": "#000000"}
SMALLEST = 1e-6
"""Errors below are drawn there, as a logarithm has no 0."""


def figure(width: float, height: float) -> "Figure":
    """An empty one, in inches; ValueError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ValueError(f"figures need matplotlib: {install_command('plots')}") from None
    return Figure(figsize=(width, height), layout="constrained")


def png(figure: "Figure") -> bytes:
    written = BytesIO()
    figure.savefig(written, format="png", dpi=110)
    return written.getvalue()


def rate_curves(
    axis: str, places: Sequence[Any], rates: Mapping[str, Sequence[tuple[float, float, float]]]
) -> bytes:
    """A PNG of rates in % over what was swept; lines differ by mark, not by colour alone.

    Args:
        axis: name of what was swept.
        places: its values, numbers or texts.
        rates: rate, low and high limit (0 to 1) at each, by outcome.
    """
    drawn = figure(6, 3.4)
    panel = drawn.subplots()
    numbers = all(isinstance(place, int | float) for place in places)
    at = list(places) if numbers else list(range(len(places)))
    for number, (outcome, values) in enumerate(rates.items()):
        shares = [100 * rate for rate, _, _ in values]
        below = [100 * (rate - low) for rate, low, _ in values]
        above = [100 * (high - rate) for rate, _, high in values]
        style = LINES[number % len(LINES)] + MARKS[outcome]
        panel.errorbar(
            at, shares, (below, above), fmt=style, color=COLOURS[outcome], label=outcome, capsize=3
        )
    if not numbers:
        names = [str(place) for place in places]
        crowded = sum(map(len, names)) > MOST_LETTERS
        side: dict[str, Any] = (
            {"rotation": 30, "ha": "right", "rotation_mode": "anchor"} if crowded else {}
        )
        panel.set_xticks(at, names, **side)
    panel.set(xlabel=axis, ylabel="% of results, with 95 % limits", ylim=(-4, 104))
    panel.grid(alpha=0.3)
    _explain(drawn, "small")
    return png(drawn)


def _explain(drawn: "Figure", size: str) -> None:
    """A legend that hides no curve: below the panel, if it is long."""
    (panel,) = drawn.axes
    names = panel.get_legend_handles_labels()[1]
    if len(names) <= MOST_INSIDE:
        panel.legend(fontsize=size)
        return
    columns = 2 if max(map(len, names)) < LONG_NAME else 1
    width, height = drawn.get_size_inches()
    drawn.set_size_inches(width, height + LEGEND_LINE * -(-len(names) // columns))
    drawn.legend(fontsize=size, loc="outside lower left", ncols=columns)


def error_curves(
    name: str, errors: Mapping[str, Sequence[float]], marks: Sequence[tuple[float, str]] = ()
) -> bytes:
    """A PNG of how many of the errors are smaller, by point of the grid, with 95 % bands.

    Args:
        name: of the error, with its unit behind the last underscore.
        errors: rising sizes by the name of the point.
        marks: published values, with what they are.
    """
    drawn = figure(6, 3.4)
    panel = drawn.subplots()
    for number, (point, values) in enumerate(errors.items()):
        sizes = [max(value, SMALLEST) for value in values]
        shares = [100 * (place + 1) / len(values) for place in range(len(values))]
        # Of the whole curve: Dvoretzky, Kiefer and Wolfowitz, with Massart's constant.
        band = 100 * sqrt(log(2 / 0.05) / (2 * len(values)))
        (line,) = panel.step(
            sizes,
            shares,
            where="post",
            linestyle=LINES[number % len(LINES)],
            linewidth=1 + number // len(LINES) / 2,
            label=f"{point} ({len(values)})",
        )
        below = [max(share - band, 0) for share in shares]
        above = [min(share + band, 100) for share in shares]
        panel.fill_between(sizes, below, above, step="post", alpha=0.12, color=line.get_color())
    for number, (value, text) in enumerate(marks):
        style = LINES[-1 - number % len(LINES)]
        panel.axvline(value, color="black", linewidth=0.8, linestyle=style, label=text)
    what, unit = name.rsplit("_", 1)
    panel.set(xscale="log", xlabel=f"{what.replace('_', ' ')}, {unit}", ylabel="% smaller")
    panel.grid(alpha=0.3)
    _explain(drawn, "x-small")
    return png(drawn)


def sky_map(
    places: Sequence[tuple[float, float, str]], limits: Callable[[int, int], tuple[float, float]]
) -> bytes:
    """A PNG of how often a sensor was right results by pointing, in cells of equal area.

    Args:
        places: right ascension and declination in degrees, and what became of the picture.
        limits: 95 % limits of a rate, 0 to 1, from how many there are, of how many.
    """
    columns, rows = 18, 9
    counts = [[0] * columns for _ in range(rows)]
    right = [[0] * columns for _ in range(rows)]
    for ra_deg, dec_deg, outcome in places:
        column = min(int(ra_deg / 360 * columns), columns - 1)
        row = min(int((sin(radians(dec_deg)) + 1) / 2 * rows), rows - 1)
        counts[row][column] += 1
        right[row][column] += outcome == "right"
    rates = [
        [100 * good / of if of else float("nan") for good, of in zip(*both, strict=True)]
        for both in zip(right, counts, strict=True)
    ]
    drawn = figure(9, 4.4)
    panel = drawn.subplots()
    panel.patch.set(hatch="////", edgecolor="#aaaaaa")  # where nothing was measured
    shown = panel.imshow(
        rates, origin="lower", extent=(0, 360, -1, 1), aspect="auto", cmap="gray", vmin=0, vmax=100
    )
    for row, found in enumerate(counts):
        for column, of in enumerate(found):
            x, y = (column + 0.5) * 360 / columns, (row + 0.5) * 2 / rows - 1
            dark = of and right[row][column] < of / 2
            ink = "white" if dark else "black"
            low, high = limits(right[row][column], of) if of else (0.0, 0.0)
            told = f"{of}\n{100 * low:.0f}-{100 * high:.0f}" if of else ""
            panel.text(x, y, told, ha="center", va="center", fontsize=4.5, color=ink)
    ticks = (-90, -45, -20, 0, 20, 45, 90)
    panel.set_yticks([sin(radians(tick)) for tick in ticks], [str(tick) for tick in ticks])
    panel.set_xticks(range(0, 361, 60))
    panel.set(xlabel="right ascension, deg", ylabel="declination, deg")
    drawn.colorbar(shown, label="% right; in a cell: results, 95 % limits")
    return png(drawn)


SHADES = ("#ffffff", "#dddddd", "#bbbbbb", "#999999", "#777777", "#555555", "#333333", "#000000")
HATCHES = ("", "..", "//", "", "xx", "\\\\", "", "++", "")


def effects(
    parts: Sequence[tuple[str, int]],
    counts: Mapping[Any, Sequence[int]],
    seen: Sequence[tuple[float, float]],
    what: str,
) -> bytes:
    """A PNG of bars, one a register or memory, of what share of its upsets did what.

    Args:
        parts: name, and number of upsets.
        counts: of each part, by effect; effects that never were are left out.
        seen: of each part, 95 % limits of how often something is seen, 0 to 1.
        what: whose upsets they are.
    """
    shown = {effect: values for effect, values in counts.items() if any(values)}
    drawn = figure(9, 1.2 + 0.22 * len(parts))
    panel = drawn.subplots()
    places = range(len(parts))
    before = [0.0 for _ in parts]
    for number, (effect, values) in enumerate(shown.items()):
        shares = [100 * value / of for value, (_, of) in zip(values, parts, strict=True)]
        panel.barh(
            places,
            shares,
            left=before,
            label=f"{effect} ({sum(values)})",
            color=SHADES[number * (len(SHADES) - 1) // max(1, len(shown) - 1)],
            hatch=HATCHES[number],
            edgecolor="#444444",
            linewidth=0.5,
        )
        before = [sum(both) for both in zip(before, shares, strict=True)]
    middles = [100 - 50 * (low + high) for low, high in seen]
    halves = [50 * (high - low) for low, high in seen]
    panel.errorbar(
        *(middles, places),
        xerr=halves,
        label="seen to the right, 95 %",
        fmt="none",
        ecolor="#cc3311",
        capsize=2.5,
        elinewidth=1.2,
    )
    panel.set_yticks(places, [f"{name} ({of})" for name, of in parts], fontsize="x-small")
    panel.invert_yaxis()
    panel.set(xlabel=f"% of {what}", xlim=(0, 100))
    panel.legend(fontsize="x-small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return png(drawn)


def save_curves(
    rows: Mapping[str, Sequence[Any]],
    axis: str,
    title: str,
    limits: Callable[[int, int], tuple[float, float]],
    path: Path,
) -> None:
    """Write shares of right, refused and wrong frames against strength, a panel for each device.

    Args:
        rows: points by the device's name; each with strength, pictures, right, refused, wrong.
        axis: what strength is, with its unit.
        title: of the whole.
        limits: of a rate; the bands of right and wrong.
        path: of the PNG.

    Raises:
        ValueError: matplotlib is not installed.
    """
    drawn = figure(3.2 * max(len(rows), 1.6), 2.9)
    panels = drawn.subplots(1, len(rows), sharey=True, squeeze=False)[0]
    for panel, (name, points) in zip(panels, rows.items(), strict=True):
        places = range(len(points))
        for kind in ("right", "refused", "wrong"):
            colour = COLOURS[kind]
            shares = [100 * getattr(point, kind) / point.pictures for point in points]
            panel.plot(places, shares, marker=MARKS[kind], color=colour, label=kind, linewidth=1.5)
            if kind != "refused":
                bands = [limits(getattr(point, kind), point.pictures) for point in points]
                low, high = np.array(bands).T * 100
                panel.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        panel.set_xticks(places, [f"{point.strength:g}" for point in points])
        panel.set(title=name, xlabel=axis, ylim=(-4, 104))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("% of pictures")
    panels[0].legend(loc="center left", fontsize="small")
    drawn.suptitle(title, fontsize="medium")
    drawn.savefig(path, dpi=110)
