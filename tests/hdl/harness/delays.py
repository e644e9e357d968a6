"""Longest delays of a placed iCE40 design, from the SDF file that nextpnr writes.

The delays are the tool's, for the slowest part; those of the pads themselves are not in it.
"""

import re
import tempfile
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

from amaranth.lib.wiring import Component

from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import run_nextpnr_ice40, yosys_files

_WIRE = re.compile(r"\(INTERCONNECT (\S+)/(\w+) (\S+)/(\w+) \(\d+:\d+:(\d+)\)")
_INSTANCE = re.compile(r"\(INSTANCE (\S+)\)")
_CELL = re.compile(r"\(IOPATH (\w+) (\w+) \(\d+:\d+:(\d+)\)")


class Delay(NamedTuple):
    """From a pad to a pad in ps, through logic alone and through a flip-flop; None without one."""

    logic_ps: int | None = None
    clocked_ps: int | None = None


@cache
def sdf_of(make: type[Component]) -> str:
    """The slowest and largest iCE40 with enough pins; needs the extras hdl and place."""
    script = "read_rtlil design.il\nsynth_ice40 -top top -json design.json\n"
    _, netlist = yosys_files(script, {"design.il": rtlil_text(make())}, "design.json")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "design.json").write_text(netlist, encoding="utf-8")
        arguments = "--lp8k --package cm225 --seed 1 --json design.json --sdf design.sdf"
        run_nextpnr_ice40(["-q", *arguments.split()], folder)
        return (folder / "design.sdf").read_text(encoding="utf-8")


def pad_delays(sdf: str, pad: str) -> dict[str, Delay]:
    """Delays from the input ``pad`` to each output pad, as NAME or NAME[BIT]."""
    edges = defaultdict(list)
    instance = ""
    for line in sdf.replace("\\", "").splitlines():
        if wire := _WIRE.search(line):
            source, out, sink, into, delay = wire.groups()
            edges[source, out].append(((sink, into), int(delay), False))
        elif found := _INSTANCE.search(line):
            instance = found[1]
        elif path := _CELL.search(line):
            edges[instance, path[1]].append(((instance, path[2]), int(path[3]), path[1] == "CLK"))
    longest = {((f"{pad}$sb_io", "D_IN_0"), False): 0}
    changed = [*longest]
    while changed:
        pin, clocked = changed.pop()
        for sink, delay, flop in edges[pin]:
            reached = longest[pin, clocked] + delay
            key = sink, clocked or flop
            if reached > longest.get(key, -1):
                longest[key] = reached
                changed.append(key)
    ends = {cell for (cell, pin), _ in longest if pin == "D_OUT_0"}
    return {
        cell.removesuffix("$sb_io"): Delay(
            longest.get(((cell, "D_OUT_0"), False)), longest.get(((cell, "D_OUT_0"), True))
        )
        for cell in ends
    }
