"""Figures of campaigns: rates over what was swept, and distributions of errors."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        raise ValueError("figures need matplotlib: pip install cubestack[plots]") from None
    return Figure(figsize=(width, height), layout="constrained")


def png(figure: "Figure") -> bytes:
    """A figure as a PNG's bytes."""
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
        panel.set_xticks(at, [str(place) for place in places])
    panel.set(xlabel=axis, ylabel="% of results, with 95 % limits", ylim=(-4, 104))
    panel.grid(alpha=0.3)
    panel.legend(fontsize="small")
    return png(drawn)


def error_curves(name: str, errors: Mapping[str, Sequence[float]]) -> bytes:
    """A PNG of how many of the errors are smaller, by point of the grid.

    Args:
        name: of the error, with its unit behind the last underscore.
        errors: sizes, rising, by what the point is told as.
    """
    drawn = figure(6, 3.4)
    panel = drawn.subplots()
    for number, (point, values) in enumerate(errors.items()):
        shares = [100 * (place + 1) / len(values) for place in range(len(values))]
        panel.step(
            [max(value, SMALLEST) for value in values],
            shares,
            where="post",
            linestyle=LINES[number % len(LINES)],
            linewidth=1 + number // len(LINES) / 2,
            label=f"{point} ({len(values)})",
        )
    what, unit = name.rsplit("_", 1)
    panel.set(xscale="log", xlabel=f"{what.replace('_', ' ')}, {unit}", ylabel="% smaller")
    panel.grid(alpha=0.3)
    panel.legend(fontsize="x-small")
    return png(drawn)
