"""History of the ratios that `cubestack bench` measures: a column for each release, on a page.

``make bench-history`` measures the present version, replaces its ratios, and renews the page.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cubestack.host.devices.registry import devices
from cubestack.host.output import write_output
from cubestack.host.studies.ratios import MEANINGS, device_ratios, light_ratio
from cubestack.host.terminal import busy
from tests.benchmarks.engines import speeds
from tests.benchmarks.engines.workloads import WORKLOADS
from tests.system.documents.blocks import ROOT

PAGE, DATA = "benchmarks.md", "data/benchmarks.json"
BEGIN, END = "<!-- ratios -->\n", "<!-- end -->\n"
VERILATOR = "verilator_TOP_ratio"

Ratios = dict[str, float]


def meanings() -> dict[str, str]:
    """Of each ratio, by its name."""
    found = {
        name: meaning
        for device in devices()
        if (benchmark := device.study("bench"))
        for name, meaning in benchmark.figures.items()
    }
    return found | MEANINGS | {VERILATOR: "RTL, each clock singly: Verilator's time by ours"}


def pattern(name: str) -> str:
    """The name without the device, top or number of it: what its meaning is for."""
    if name.startswith("verilator_"):
        return VERILATOR
    if name.endswith(("_loops_ratio", "_serial_ratio", "_reuse_ratio")):
        return "DEVICE_" + name.split("_", 1)[1]
    return re.sub(r"^identify_\w+_ratio$", "identify_N_ratio", name)


def measured() -> Ratios:
    """All ratios of the present version that this machine can measure."""
    found = light_ratio()
    for device in devices():
        if benchmark := device.study("bench"):
            found |= benchmark.run(device) | device_ratios(device.name)
    return {name: value for name, value in found.items() if "_ratio" in name} | verilator_ratios()


def verilator_ratios() -> Ratios:
    """Of each top; empty where Verilator or a compiler is missing."""
    if speeds.absent().keys() & {"compiled", "verilator"}:
        return {}
    found = {}
    for top in WORKLOADS:
        speeds.prepare(top)
        rates = {one.engine: one.clocks_per_s for one in speeds.measure(top)}
        found[f"verilator_{top}_ratio"] = round(rates["compiled"] / rates["verilator"], 2)
    return found


def table(history: Mapping[str, Ratios]) -> str:
    """The ratios of all versions, the newest first."""
    versions = list(reversed(history))
    names = sorted({name for ratios in history.values() for name in ratios})
    rows = [["ratio", *versions], ["---"] * (1 + len(versions))]
    for name in names:
        values = [history[version].get(name) for version in versions]
        rows.append([f"`{name}`", *("" if one is None else f"{one:g}" for one in values)])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def page(text: str, history: Mapping[str, Ratios]) -> str:
    """The page with the present table."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n{table(history)}\n{END}{rest.partition(END)[2]}"


def load(docs: Path) -> dict[str, Ratios]:
    """Ratios by version, the oldest first."""
    stored: Any = json.loads((docs / DATA).read_text("utf-8"))
    return dict(stored)


def store(docs: Path, version: str, ratios: Ratios) -> None:
    """Keep ``ratios`` as those of ``version``, and renew the page."""
    history = load(docs) | {version: dict(sorted(ratios.items()))}
    write_output(docs / DATA, json.dumps(history, indent=1) + "\n")
    text = (docs / PAGE).read_text("utf-8")
    write_output(docs / PAGE, page(text, history))


def main() -> int:
    from importlib.metadata import version

    with busy("measuring the ratios"):
        ratios = measured()
    store(ROOT / "docs", version("cubestack"), ratios)
    return 0


if __name__ == "__main__":
    sys.exit(main())
