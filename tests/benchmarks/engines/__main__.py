"""How fast each engine is on each top, as a table or as JSON.

examples, from the project's folder:
  make bench-engines
  python -m tests.benchmarks.engines --json

Exit status 2 when an engine fails or stores something else than the cameras sent.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from rich.box import SIMPLE
from rich.table import Table

from cubestack.emulator.native.compiler import CompilerError
from cubestack.host.terminal import console, progress_bar, say
from tests.benchmarks.engines import speeds
from tests.benchmarks.engines.icarus import CocotbError
from tests.benchmarks.engines.speeds import ENGINES, Speed
from tests.benchmarks.engines.workloads import WORKLOADS, WrongPictureError


def main(argv: Sequence[str] | None = None) -> int:
    """Measures and reports; 2 if an engine fails."""
    parser = argparse.ArgumentParser(
        prog="engines", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args(argv)
    missing = speeds.absent()
    found: list[Speed] = []
    try:
        with progress_bar() as bar:
            task = bar.add_task("building", total=len(WORKLOADS))
            with ThreadPoolExecutor(2) as pool:
                for _ in pool.map(speeds.prepare, WORKLOADS):
                    bar.advance(task)
            task = bar.add_task("measuring", total=len(WORKLOADS) * (len(ENGINES) - len(missing)))
            for top in WORKLOADS:
                for speed in speeds.measure(top):
                    found.append(speed)
                    bar.advance(task)
    except (CompilerError, CocotbError, WrongPictureError) as error:
        say(f"error: {error}")
        return 2
    if args.json:
        print(json.dumps(_report(found, missing)))
        return 0
    console.print(_table(found, [name for name in ENGINES if name not in missing]))
    for name, what in missing.items():
        say(f"{name} is absent: install {what}")
    return 0


def _by_top(found: list[Speed]) -> dict[str, dict[str, float]]:
    tops: dict[str, dict[str, float]] = {}
    for top, engine, clocks_per_s in found:
        tops.setdefault(top, {})[engine] = clocks_per_s
    return tops


def _report(found: list[Speed], missing: dict[str, str]) -> dict[str, object]:
    """Clocks per second, and the ratio of the compiled engine to each other one."""
    clocks, ratio = {}, {}
    for top, rates in _by_top(found).items():
        clocks[top] = {name: round(rate) for name, rate in rates.items()}
        best = rates.pop("compiled", None)
        ratio[top] = {name: round(best / rate, 1) for name, rate in rates.items() if best}
    return {"clocks_per_s": clocks, "ratio": ratio, "absent": missing}


def _table(found: list[Speed], engines: list[str]) -> Table:
    table = Table(
        title="pixel clocks per second, none skipped; x: speed of compiled relative to it",
        box=SIMPLE,
        padding=0,
    )
    table.add_column("top", no_wrap=True)
    for name in engines:
        table.add_column(name, justify="right", no_wrap=True)
    for top, rates in _by_top(found).items():
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


if __name__ == "__main__":
    sys.exit(main())
