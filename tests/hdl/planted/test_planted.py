"""Each bug that is planted in the designs' source is caught by the tier of each top that has it."""

from pathlib import Path

import pytest

from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.planted.bugs import BUGS, STAR, Bug, planted
from tests.hdl.regression import FULL, TIERS, run_tier
from tests.tiers import quick

pytestmark = [
    pytest.mark.cocotb,
    pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable"),
]

#: One of each kind, on the published board, is tried in `make test` too.
QUICK = {bug.kind: bug for bug in reversed(BUGS) if STAR in bug.tops}
KINDS = dict.fromkeys(bug.kind for bug in BUGS)
CASES = [
    pytest.param(bug, top, id=f"{bug.kind}, {bug.title}, {bug.module}-{top}")
    for bug in BUGS
    for top in bug.tops
    if FULL or (top == STAR and bug is QUICK[bug.kind])
]


def wrong_verilog(bug: Bug, top: str) -> str:
    tier = TIERS[top]
    with planted(bug) as names:
        design = names.get(tier.design.__name__, tier.design)
        return verilog_text(design(tier.columns, tier.rows), "dut")


@pytest.mark.parametrize(("bug", "top"), quick(CASES, 4))
def test_is_caught(bug: Bug, top: str, tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text(wrong_verilog(bug, top), encoding="utf-8")
    outcome = run_tier(top, tmp_path / "dut.v", tmp_path / "tier")
    assert outcome.failed, outcome.problem or "not caught"


def test_every_kind_is_planted_in_both_sensors() -> None:
    for kind in KINDS:
        tops = {top for bug in BUGS if bug.kind == kind for top in bug.tops}
        assert {"cubestar", "cubesense-pair"} <= tops, kind


def test_document_has_every_bug() -> None:
    document = Path(__file__).parents[3] / "docs" / "gateware-tests.md"
    _, _, section = document.read_text(encoding="utf-8").partition("| Kind | Bugs |\n|---|---|\n")
    titles = {kind: dict.fromkeys(b.title for b in BUGS if b.kind == kind) for kind in KINDS}
    rows = [f"| {kind} | {'; '.join(those)} |" for kind, those in titles.items()]
    assert section.startswith("\n".join([*rows, "\n"]))


def test_nothing_is_left_behind() -> None:
    before = verilog_text(TIERS[STAR].make(), "dut")
    wrong_verilog(BUGS[0], STAR)
    assert verilog_text(TIERS[STAR].make(), "dut") == before


def test_missing_text_is_an_error() -> None:
    bug = Bug("", "", "blocks.frame_writer", "no such text", "", (STAR,))
    with pytest.raises(ValueError, match="has 'no such text' 0 times, not once"):
        wrong_verilog(bug, STAR)
