"""Builds the bitstream of a bridged design for a development board, and reports whether it fits."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from cubestack.firmware_model.interface.devboard import Lines
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.devboard.boards import Board, Family
from cubestack.hdl.devboard.bridge import BridgeTiming
from cubestack.hdl.devboard.bridged import BoardTop, Bridged, bridged_rtlil
from cubestack.hdl.flow.tools import ToolError, run_packer, run_placer, run_yosys

#: Files of a build: the bitstream, the placed netlist, the placer's report, what was built.
BITSTREAM, PLACED, REPORT, BUILD = "board.bin", "placed.json", "report.json", "build.json"

#: The cells of each family that are logic.
_LOGIC: Mapping[Family, str] = {"ice40": "ICESTORM_LC", "ecp5": "TRELLIS_COMB"}

_SYNTHESIS: Mapping[Family, str] = {
    "ice40": "synth_ice40 -top top -json design.json",
    "ecp5": "synth_ecp5 -top top -json design.json",
}


class BoardError(ToolError):
    """A design that a board can't run; the text is one line."""


@dataclass(frozen=True)
class Fit:
    """Result of a build; rates in MHz, delays in ns."""

    board: str
    top: str
    logic_cells: int
    logic_cells_available: int
    memories: int
    memories_available: int
    bridge_mhz: float
    bridge_mhz_needed: float
    settling_ns: float  #: the longest way from the bridge through the design and back
    settling_ns_allowed: float

    @property
    def problem(self) -> str:
        """What is wrong; empty if the design runs on the board."""
        if self.bridge_mhz < self.bridge_mhz_needed:
            return (
                f"{self.top} on {self.board} runs at {self.bridge_mhz:.1f} MHz, slower than the "
                f"{self.bridge_mhz_needed:g} MHz needed; choose a faster board"
            )
        if self.settling_ns > self.settling_ns_allowed:
            return (
                f"{self.top} on {self.board} settles in {self.settling_ns:.0f} ns, later than the "
                f"{self.settling_ns_allowed:.0f} ns allowed; choose a faster board"
            )
        return ""

    def values(self) -> dict[str, str | int | float]:
        """For JSON."""
        return {**asdict(self), "problem": self.problem}

    def text(self) -> str:
        return "\n".join(
            (
                f"{self.top} on {self.board}",
                f"  logic cells   {self.logic_cells} of {self.logic_cells_available} "
                f"({self.logic_cells / self.logic_cells_available:.0%})",
                f"  memories      {self.memories} of {self.memories_available}",
                f"  bridge clock  {self.bridge_mhz:.1f} MHz, {self.bridge_mhz_needed:g} MHz needed",
                f"  settling      {self.settling_ns:.0f} ns, {self.settling_ns_allowed:.0f} ns "
                "allowed",
            )
        )


@dataclass(frozen=True)
class Built:
    """What a folder contains; ``divider``: clocks of the bridge per bit of the serial line."""

    board: str
    family: Family
    top: str
    divider: int

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Raises FileNotFoundError if the folder has no finished build."""
        return cls(**json.loads((folder / BUILD).read_text(encoding="utf-8")))


def build(
    component: PinnedComponent,
    lines: Lines,
    board: Board,
    timing: BridgeTiming,
    name: str,
    folder: Path,
) -> Fit:
    """Synthesise, place, route and pack into ``folder``, which is created.

    The bitstream is written only if the design is fast enough: see ``Fit.problem``.

    Raises:
        ToolMissingError: an extra is not installed.
        BoardError: the design does not fit.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in (BITSTREAM, BUILD):
        (folder / old).unlink(missing_ok=True)
    top = BoardTop(board, Bridged(component, lines, timing, name))
    (folder / "design.il").write_text(bridged_rtlil(top, component), encoding="utf-8")
    (folder / "pins").write_text(board.constraints, encoding="utf-8")
    run_yosys(f"read_rtlil design.il\n{_SYNTHESIS[board.family]}\n", folder)
    text = "board.asc" if board.family == "ice40" else "board.config"
    files = {
        "ice40": ("--pcf", "pins", "--asc", text),
        "ecp5": ("--lpf", "pins", "--textcfg", text),
    }
    arguments = [*board.part, *files[board.family], "--json", "design.json", "--write", PLACED]
    arguments += ["--report", REPORT, "--seed", "1", "--timing-allow-fail"]
    try:
        run_placer(board.family, arguments, folder)
    except ToolError as error:
        reason = ", ".join(too_many(error.output)) or str(error)
        raise BoardError(f"{name} does not fit on {board.name}: {reason}") from error
    report = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    fit = _fit(report, board, timing, name)
    built = Built(board.name, board.family, name, timing.divider)
    (folder / BUILD).write_text(json.dumps(asdict(built), indent=1), encoding="utf-8")
    if not fit.problem:
        run_packer(board.family, text, BITSTREAM, folder)
    return fit


def too_many(output: str) -> Iterator[str]:
    """The cells that the part lacks, from the placer's list of what is used."""
    for kind, used, available in re.findall(r"(\w+): +(\d+)/ *(\d+) +\d+%", output):
        if int(used) > int(available):
            yield f"{used} of {available} {kind}"


def _fit(report: dict[str, Any], board: Board, timing: BridgeTiming, name: str) -> Fit:
    cells = report["utilization"]
    logic = cells[_LOGIC[board.family]]
    memory = cells["ICESTORM_RAM" if board.family == "ice40" else "DP16KD"]
    bridge = next(rate for clock, rate in report["fmax"].items() if _is_bridge(clock))
    return Fit(
        board.name,
        name,
        logic["used"],
        logic["available"],
        memory["used"],
        memory["available"],
        bridge["achieved"],
        timing.clock_hz / 1e6,
        _settling_ns(report["critical_paths"]),
        timing.settle * 1e9 / timing.clock_hz,
    )


def _is_bridge(clock: str) -> bool:
    return "inputs" not in clock and "design" not in clock


def _settling_ns(paths: list[dict[str, Any]]) -> float:
    """The longest path into a clock of the design, and the longest from one to the bridge."""
    longest = [0.0, 0.0]
    for path in paths:
        source, sink = (path[end].removeprefix("posedge ") for end in ("from", "to"))
        delay = sum(part["delay"] for part in path["path"])
        if "<async>" in (source, sink) or _is_bridge(source) == _is_bridge(sink):
            continue
        way = int(_is_bridge(sink))
        longest[way] = max(longest[way], delay)
    return sum(longest)
