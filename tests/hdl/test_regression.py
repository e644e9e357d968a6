"""The regression itself: the same seed gives the same run, and wrong designs do not get through.

A failing simulation fails pytest, whatever else may break, and leaves a waveform.
"""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.conftest import REWRITING
from tests.hdl.regression import STAR, TIERS, build, frame_environment, modules, run_tier, simulate

pytestmark = pytest.mark.cocotb

READ, ONLY = modules(STAR, "read"), "both_banks"


@pytest.fixture
def verilog(tmp_path: Path) -> Path:
    """The published board's, small."""
    path = tmp_path / "dut.v"
    path.write_text(verilog_text(TIERS["cubestar"].make(), "dut"), encoding="utf-8")
    return path


def moments(results: Path) -> dict[str, str]:
    return {
        str(case.get("name")): str(part.get("value"))
        for case in ElementTree.parse(results).iter("testcase")
        for part in case.iter("property")
        if part.get("name") == "sim_time_stop"
    }


@pytest.mark.slow
def test_same_seed_repeats_the_simulation(verilog: Path, tmp_path: Path) -> None:
    """To the picosecond, where every moment is random."""
    runner = build(verilog, tmp_path / "build")
    found = []
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        environment = frame_environment(5, 3)
        run = tmp_path / name
        outcome = simulate(runner, READ, run, seed=seed, environment=environment, only=ONLY)
        assert outcome.passed
        found.append(moments(run / "results.xml"))
    first, again, other = found
    assert len(first) == len(outcome.ran)
    assert first == again
    assert all(first[name] != other[name] for name in first)


@pytest.mark.slow
def test_tier_stops_at_the_first_failure(
    verilog: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(REWRITING, "*.py")  # else a plain assertion has no words
    text = verilog.read_text(encoding="utf-8")
    inverted = text.replace("assign SRAM_WE_N = ", "assign SRAM_WE_N = ~ ", 1)
    assert inverted != text
    verilog.write_text(inverted, encoding="utf-8")
    outcome = run_tier("cubestar", verilog, tmp_path / "tier")
    assert not outcome.passed
    assert len(outcome.failed) == 1
    assert outcome.error


def test_reports_compile_errors(tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text("module dut(", encoding="utf-8")
    outcome = run_tier("cubestar", tmp_path / "dut.v", tmp_path / "tier")
    assert outcome.problem == "does not compile"
    assert "syntax error" in outcome.log


@pytest.mark.slow
def test_hanging_simulation_is_terminated(verilog: Path, tmp_path: Path) -> None:
    text = verilog.read_text(encoding="utf-8")
    loop = "reg loop = 0;\n  always @(posedge PIXCLK) forever loop = ~loop;\n"
    head, tail = text.split("module dut(", 1)
    body = tail.replace("endmodule", f"{loop}endmodule", 1)
    verilog.write_text(f"{head}module dut({body}", encoding="utf-8")
    outcome = run_tier("cubestar", verilog, tmp_path / "tier", limit_s=1)
    # Told to end, a simulation may still write that its test failed.
    assert outcome.failed or outcome.problem == "the simulation gave no results"


@pytest.fixture
def failing(icarus: Any, tmp_path: Path) -> Any:
    """Keeps its waveforms apart from those of other runs."""
    return type(icarus)(tmp_path, tmp_path / "waves")


def test_failing_cocotb_tests_are_named_until_they_pass(failing: Any, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"failed: \['fails', 'fails_in_the_background'\]"):
        failing.run(MatrixCounter, 2, 2, "tests.hdl.harness.failing", seed=1)
    (waveform,) = (tmp_path / "waves").glob("*.vcd")
    assert waveform.stem == "regression.failing_cocotb_tests_are_named_until_they_pass.fails"
    assert "$enddefinitions" in waveform.read_text(encoding="utf-8")
    about = json.loads(waveform.with_suffix(".json").read_text(encoding="utf-8"))
    assert about["title"].startswith("fails of tests/hdl/test_regression.py::test_failing")
    assert "as it should" in about["error"]
    failing.run(MatrixCounter, 2, 2, "tests.hdl.blocks.testbenches.matrix_counter", seed=1)
    assert not list((tmp_path / "waves").iterdir())


def test_module_that_cannot_be_loaded_fails(failing: Any) -> None:
    with pytest.raises((AssertionError, RuntimeError)):
        failing.run(MatrixCounter, 2, 2, "tests.hdl.harness.missing", seed=1)
