"""The table of `cubestack bench --engines`: each engine on each top, in one run."""

import json
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.table import Table

from cubestack.host.cli.terminal import console, progress_bar, say

if TYPE_CHECKING:
    from cubestack.emulator.rtl.engine_speeds import Speed

__all__ = ["bench_engines"]


def bench_engines(*, as_json: bool) -> int:
    """Measure and report; 2 when an engine fails, which is said."""
    from cubestack.emulator.rtl.cocotb_icarus import CocotbError
    from cubestack.emulator.rtl.cxxrtl.build import CompilerError
    from cubestack.emulator.rtl.engine_speeds import ENGINES, absent, measure, prepare
    from cubestack.emulator.rtl.workloads import WORKLOADS, WrongPictureError

    missing = absent()
    speeds: list[Speed] = []
    try:
        with progress_bar() as bar:
            task = bar.add_task("building", total=len(WORKLOADS))
            with ThreadPoolExecutor(2) as pool:
                for _ in pool.map(prepare, WORKLOADS):
                    bar.advance(task)
            task = bar.add_task("measuring", total=len(WORKLOADS) * (len(ENGINES) - len(missing)))
            for top in WORKLOADS:
                for speed in measure(top):
                    speeds.append(speed)
                    bar.advance(task)
    except (CompilerError, CocotbError, WrongPictureError) as error:
        say(f"error: {error}")
        return 2
    if as_json:
        print(json.dumps(_report(speeds, missing)))
        return 0
    console.print(_table(speeds, [name for name in ENGINES if name not in missing]))
    for name, what in missing.items():
        say(f"{name} is absent: install {what}")
    return 0


def _by_top(speeds: list["Speed"]) -> dict[str, dict[str, float]]:
    tops: dict[str, dict[str, float]] = {}
    for top, engine, clocks_per_s in speeds:
        tops.setdefault(top, {})[engine] = clocks_per_s
    return tops


def _report(speeds: list["Speed"], missing: dict[str, str]) -> dict[str, object]:
    """Clocks a second, and how many times as many the compiled engine makes as each other one."""
    return {
        "clocks_per_s": {
            top: {name: round(rate) for name, rate in rates.items()}
            for top, rates in _by_top(speeds).items()
        },
        "ratio": {
            top: {
                name: round(rates["compiled"] / rate, 1)
                for name, rate in rates.items()
                if name != "compiled" and "compiled" in rates
            }
            for top, rates in _by_top(speeds).items()
        },
        "absent": missing,
    }


def _table(speeds: list["Speed"], engines: list[str]) -> Table:
    table = Table(
        title="pixel clocks a second, none skipped; x: compiled makes so many times as many",
        box=SIMPLE,
        padding=0,
    )
    table.add_column("top", no_wrap=True)
    for name in engines:
        table.add_column(name, justify="right", no_wrap=True)
    for top, rates in _by_top(speeds).items():
        cells = []
        for name in engines:
            times = rates["compiled"] / rates[name] if "compiled" in rates else 1.0
            ratio = f" x {times:,.{0 if times > 99 else 1}f}" if times != 1 else ""
            cells.append(_short(rates[name]) + ratio)
        table.add_row(top, *cells)
    return table


def _short(rate: float) -> str:
    for limit, unit in ((1e6, "M"), (1e3, "k")):
        if rate >= limit:
            return f"{rate / limit:.1f} {unit}"
    return f"{rate:.0f}"
