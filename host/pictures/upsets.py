"""Figure of an atlas of upsets: what becomes of each register's, told apart in greyscale."""

from collections.abc import Mapping, Sequence
from typing import Any

from cubestack.host.pictures.campaigns import figure, png

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
