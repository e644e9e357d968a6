"""Area of a table of tops, and comparison with a recorded file.

``area.json`` beside a sensor's tops records what they took when last checked. The iCE40 counts are
a public reference: other designs publish their 4-input tables. The clock rates come from one
placement on its HX8K, not on the AGLN030.
"""

import json
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from amaranth.lib.wiring import Component

from cubestack.hdl.flow.area import AGLN030_TILES, TileCount, count_tiles
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import run_nextpnr_ice40, yosys_files
from cubestack.hdl.flow.top import Top, TopTable

#: Fraction by which a design may exceed the recorded area.
GROWTH = 0.05


class Ice40Count(NamedTuple):
    """Cells of an iCE40, before placement."""

    lut4: int
    flip_flops: int
    carries: int


class Area(NamedTuple):
    """Area of a design; ``top`` is False for a block; ``fmax`` in MHz per clock."""

    name: str
    top: bool
    tiles: TileCount
    ice40: Ice40Count | None = None
    fmax: dict[str, float] | None = None


def count_ice40(component: Component) -> Ice40Count:
    """Cells that Yosys' ``synth_ice40`` maps ``component`` to; needs the extra ``hdl``."""
    script = "read_rtlil design.il\nsynth_ice40 -top top\nwrite_json design.json\n"
    _, text = yosys_files(script, {"design.il": rtlil_text(component)}, "design.json")
    cells = Counter(cell["type"] for cell in json.loads(text)["modules"]["top"]["cells"].values())
    return Ice40Count(
        cells["SB_LUT4"],
        sum(count for name, count in cells.items() if name.startswith("SB_DFF")),
        cells["SB_CARRY"],
    )


def ice40_fmax(component: Component) -> dict[str, float]:
    """Highest rate in MHz of each clock, placed and routed once; needs the extra ``place``."""
    script = "read_rtlil design.il\nsynth_ice40 -top top -json design.json\n"
    _, netlist = yosys_files(script, {"design.il": rtlil_text(component)}, "design.json")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "design.json").write_text(_clocks_named_by_ports(netlist), encoding="utf-8")
        arguments = "--hx8k --package ct256 --seed 1 --json design.json --report report.json"
        run_nextpnr_ice40(["-q", *arguments.split()], folder)
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    rates = {
        name.partition("$")[0].replace("_I[", "["): rate["achieved"]
        for name, rate in report["fmax"].items()
    }
    return {name: round(rates[name], 1) for name in sorted(rates)}


def _clocks_named_by_ports(netlist: str) -> str:
    """Drop other names of an input pin's net, so that the placer reports the pin's name."""
    content = json.loads(netlist)
    top = content["modules"]["top"]
    ports = top["ports"]
    inputs = {bit for p in ports.values() if p["direction"] == "input" for bit in p["bits"]}
    top["netnames"] = {
        name: net
        for name, net in top["netnames"].items()
        if name in ports or not inputs & {*net["bits"]}
    }
    return json.dumps(content)


def areas(table: TopTable, ice40: bool = False, fmax: bool = False) -> Iterator[Area]:
    """Area of each design; ``ice40`` takes some seconds more for each.

    ``fmax`` takes some ten seconds more for each top; blocks, not being whole designs, have none.
    """
    for name, design in table.items():
        make, top = design.make, isinstance(design, Top)
        yield Area(
            name,
            top,
            count_tiles(make()),
            count_ice40(make()) if ice40 else None,
            ice40_fmax(make()) if fmax and top else None,
        )


def area_table(rows: Iterable[Area]) -> Iterator[str]:
    rows = list(rows)
    width = max(len(row.name) for row in rows)
    ice40 = any(row.ice40 for row in rows)
    yield f"{'':{width}}  tables  flip-flops  tiles  of {AGLN030_TILES}" + (
        "   iCE40: LUT4  flip-flops  carries" if ice40 else ""
    )
    for row in rows:
        tables, flip_flops = row.tiles
        total = row.tiles.total
        part = f"{total / AGLN030_TILES:6.1%}" if row.top else ""
        line = f"{row.name:{width}}  {tables:6}  {flip_flops:10}  {total:5}  {part:>6}"
        if row.ice40:
            line += f"   {row.ice40.lut4:11}  {row.ice40.flip_flops:10}  {row.ice40.carries:7}"
        if row.fmax:
            line += "   MHz: " + ", ".join(f"{name} {rate:.0f}" for name, rate in row.fmax.items())
        yield line.rstrip()


def area_json(rows: Iterable[Area]) -> str:
    """The rows as JSON; with the iCE40's counts, the content of a recorded file."""
    counts: dict[str, dict[str, Any]] = {}
    for row in rows:
        counts[row.name] = {
            "kind": "top" if row.top else "block",
            **row.tiles._asdict(),
            "tiles": row.tiles.total,
        }
        if row.ice40:
            counts[row.name]["ice40"] = row.ice40._asdict()
        if row.fmax:
            counts[row.name]["ice40_fmax_mhz"] = row.fmax
    part = {"part": "AGLN030", "part_tiles": AGLN030_TILES}
    return json.dumps({**part, "designs": counts}, indent=1)


def recorded_areas(file: Path) -> dict[str, dict[str, Any]]:
    """Content of a recorded file, by name of the design."""
    designs: dict[str, dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))["designs"]
    return designs


def find_growth(row: Area, file: Path) -> list[str]:
    """Sentences about each count of a design that exceeds that in ``file`` by more than GROWTH."""
    known = recorded_areas(file).get(row.name)
    if known is None:
        return [f"{row.name} is not in {file.name}"]
    pairs = [("tiles", known["tiles"], row.tiles.total)]
    if row.ice40:
        pairs.append(("iCE40 LUT4s", known["ice40"]["lut4"], row.ice40.lut4))
    return [
        f"{row.name} grew from {before} to {now} {unit}, by more than {GROWTH:.0%}"
        for unit, before, now in pairs
        if now > before * (1 + GROWTH)
    ]
