"""Figures of the comparisons."""

from collections.abc import Mapping, Sequence

from cubestack.host.pictures.figures import LINES, figure, png
from cubestack.host.studies.compare.study import Rows

MARKS = "osv^D*xP+"


def rates_and_costs(
    found: Mapping[str, Rows], methods: Sequence[str], places: Mapping[str, float], usual: str
) -> bytes:
    """A PNG with two panels per tracker: images right and wrong over the number of false stars, and
    time against memory.

    Args:
        found: rows by the trackers' titles.
        places: number of false stars of the cases.
        usual: case whose time and memory are drawn.
    """
    drawn = figure(5 * max(len(found), 1), 9.5)
    panels = drawn.subplots(3, len(found), sharey="row", squeeze=False)
    for (title, rows), (right, wrong, costs) in zip(found.items(), panels.T, strict=True):
        for number, method in enumerate(methods):
            style = LINES[number % len(LINES)] + MARKS[number % len(MARKS)]
            for panel, outcome in ((right, "right"), (wrong, "wrong")):
                shares = [rows(method, case, outcome) for case in places]
                panel.plot(list(places.values()), shares, style, label=method, markersize=5)
                panel.set(xlabel="false stars", ylabel=f"% of images {outcome}", ylim=(-4, 104))
            place = rows(method, usual, "database_bytes") / 1000, rows(method, usual, "mean_ms")
            costs.plot(*place, MARKS[number % len(MARKS)], label=method)
        right.set_title(title)
        costs.set(xscale="log", xlim=(10, 1e5), xlabel="database, kB")
        costs.set(yscale="log", ylabel="mean time, ms")
        for panel in (right, wrong, costs):
            panel.grid(alpha=0.3)
    handles, names = panels[0][0].get_legend_handles_labels()
    drawn.legend(handles, names, fontsize="small", loc="outside lower center", ncols=5)
    return png(drawn)


def errors_and_times(
    found: Mapping[str, Rows], methods: Sequence[str], cases: Sequence[str], usual: str
) -> bytes:
    """A PNG with three panels per tracker: errors across and about the boresight by method, a line
    per case, and mean times in the usual case."""
    drawn = figure(5 * max(len(found), 1), 9.5)
    panels = drawn.subplots(3, len(found), sharex=True, sharey="row", squeeze=False)
    for (title, rows), column in zip(found.items(), panels.T, strict=True):
        for panel, axis in zip(column, ("cross", "roll"), strict=False):
            for number, case in enumerate(cases):
                errors = [rows(method, case, f"{axis}_arcsec") for method in methods]
                style = MARKS[number % len(MARKS)] + LINES[number % len(LINES)]
                panel.plot(range(len(methods)), errors, style, label=case, markersize=5)
            panel.set(yscale="log", ylabel=f"{axis} error, arcsec")
        times = [rows(method, usual, "mean_ms") for method in methods]
        column[2].bar(range(len(methods)), times, color="#9a9a9a")
        column[2].set(yscale="log", ylabel="mean time, ms")
        column[2].set_xticks(range(len(methods)), methods, rotation=35, ha="right")
        column[0].set_title(title)
        for panel in column:
            panel.grid(alpha=0.3)
    handles, names = panels[0][0].get_legend_handles_labels()
    drawn.legend(handles, names, fontsize="small", loc="outside lower center", ncols=len(cases))
    return png(drawn)
