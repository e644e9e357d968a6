"""Boards, rates, and what a build reports; the placer is replaced by what it writes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.hdl.devboard import bitstream
from cubestack.hdl.devboard.bitstream import BITSTREAM, BoardError, Built, Fit, build
from cubestack.hdl.devboard.boards import BOARDS
from cubestack.hdl.devboard.bridge import BridgeTiming
from cubestack.hdl.flow.tools import ToolError
from tests.hdl.devboard import exchange

ICEBREAKER = BOARDS["icebreaker"]
FIT = Fit("icebreaker", "top", 1743, 5280, 12, 30, 29.8, 24, 34, 83)


def test_constraints_have_every_port_at_its_pin() -> None:
    assert ICEBREAKER.constraints.splitlines()[:3] == [
        "set_io clk 35",
        "set_io rx 6",
        "set_io tx 9",
    ]
    text = BOARDS["ulx3s"].constraints
    for port, pin in (("clk", "G2"), ("rx", "M1"), ("tx", "L4")):
        assert f'LOCATE COMP "{port}" SITE "{pin}";' in text


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_default_rate_divides_the_clock_of_each_board(board: Any) -> None:
    assert BridgeTiming(board.bridge_hz, 3_000_000).divider * 3_000_000 == board.bridge_hz


@pytest.mark.parametrize("baud", [115_200, 921_600, 1_000_000, 2_000_000, 12_000_000])
def test_usual_rates_are_met_within_one_percent(baud: int) -> None:
    timing = BridgeTiming(24_000_000, baud)
    assert 24_000_000 / timing.divider == pytest.approx(baud, rel=0.01)


@pytest.mark.parametrize(
    ("baud", "near"), [(5_000_000, 4_800_000), (13_000_000, 12_000_000), (0, 1)]
)
def test_rate_that_the_clock_does_not_have_is_rejected(baud: int, near: int) -> None:
    with pytest.raises(ValueError, match=f"can not be divided to {baud} baud; .* {near}"):
        BridgeTiming(24_000_000, baud)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"bridge_mhz": 21.8}, "21.8 MHz, slower than the 24 MHz"),
        ({"settling_ns": 90}, "settles in 90 ns, later than the 83 ns"),
    ],
)
def test_problem_names_what_is_too_slow(changed: dict[str, Any], words: str) -> None:
    problem = replace(FIT, **changed).problem
    assert words in problem
    assert bool(problem) == bool(words)


def test_cells_that_the_part_lacks_are_named() -> None:
    printed = (
        "Info: \t ICESTORM_LC:  7967/  5280   150%\nInfo: \t ICESTORM_RAM:    12/    30    40%\n"
    )
    assert list(bitstream.too_many(printed)) == ["7967 of 5280 ICESTORM_LC"]


def delays(source: str, sink: str, *parts: float) -> dict[str, Any]:
    return {"from": source, "to": sink, "path": [{"delay": part} for part in parts]}


REPORT = {
    "utilization": {
        "ICESTORM_LC": {"used": 1743, "available": 5280},
        "ICESTORM_RAM": {"used": 12, "available": 30},
    },
    "fmax": {
        "bridged.bridge.inputs[0]_$glb_clk": {"achieved": 50},
        "bridged.bridge.clk": {"achieved": 31.0},
    },
    "critical_paths": [
        delays("posedge bridged.bridge.clk", "posedge bridged.bridge.clk", 30),
        delays("posedge bridged.bridge.clk", "posedge bridged.bridge.inputs[0]", 1, 8),
        delays("posedge bridged.bridge.inputs[0]", "posedge bridged.bridge.clk", 10, 9),
        delays("posedge bridged.bridge.inputs[9]", "posedge bridged.bridge.clk", 7),
        delays("<async>", "posedge bridged.bridge.clk", 70),
    ],
}


def place(family: str, arguments: list[str], folder: Path) -> None:
    (folder / bitstream.REPORT).write_text(json.dumps(REPORT))


def build_small(folder: Path) -> Fit:
    top = exchange.small_top()
    timing = BridgeTiming(24_000_000, 3_000_000)
    return build(top, lines_of(cubestar_wiring(top)), ICEBREAKER, timing, "small", folder)


def test_build_reports_what_the_placer_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bitstream, "run_yosys", lambda script, folder: "")
    monkeypatch.setattr(bitstream, "run_placer", place)
    packed: list[str] = []
    monkeypatch.setattr(bitstream, "run_packer", lambda *names: packed.append(names[2]))
    fit = build_small(tmp_path / "new" / "folder")
    assert (fit.logic_cells, fit.memories, fit.bridge_mhz, fit.settling_ns) == (1743, 12, 31, 28)
    assert packed == [BITSTREAM]
    assert Built.load(tmp_path / "new" / "folder") == Built("icebreaker", "ice40", "small", 8)
    assert "1743 of 5280 (33%)" in fit.text()


def test_design_that_does_not_fit_leaves_no_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(family: str, arguments: list[str], folder: Path) -> None:
        raise ToolError("nextpnr-ice40 failed: no room")

    monkeypatch.setattr(bitstream, "run_yosys", lambda script, folder: "")
    monkeypatch.setattr(bitstream, "run_placer", fail)
    (tmp_path / BITSTREAM).write_bytes(b"old")
    with pytest.raises(BoardError, match="small does not fit on icebreaker: nextpnr-ice40 failed"):
        build_small(tmp_path)
    assert not (tmp_path / BITSTREAM).exists()
