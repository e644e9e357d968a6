import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cubestack.hdl.contract import running

from ....conftest import Run


def test_tests_of_the_shipped_design_pass(tmp_path: Path, run: Run) -> None:
    junit = tmp_path / "new" / "junit.xml"
    arguments = ["--device", "cubestar", "-k", "bank", "--waves", tmp_path]
    outcome = run("hdl", "test", *arguments, "--junit", junit)
    assert outcome.code == 0
    assert "0 of 1 done  running bank_is_latched" in outcome.err
    lines = outcome.out.splitlines()
    assert lines[0].startswith("CubeStar frame buffer as shipped: contract of CubeStar frame")
    assert "passed  bank_is_latched" in lines[1]
    assert "not reached: image: bank '0', done 'stored'" in outcome.out
    assert lines[-1] == "1 passed, 0 failed"
    (case,) = ElementTree.parse(junit).iter("testcase")
    assert case.get("name") == "bank_is_latched"


@pytest.mark.slow
def test_json_has_requirements_and_missed_points(tmp_path: Path, run: Run) -> None:
    arguments = ["--device", "cubestar", "-k", "without_a_camera", "--waves", tmp_path]
    found = json.loads(run("hdl", "test", *arguments, "--json").out)
    (test,) = found["tests"]
    assert test["passed"]
    assert test["requirement"] == "Reading works when the camera gives no pixel clock"
    assert found["points"]["reached"] == 2
    assert ["bank", "0"] in found["points"]["missed"]


@pytest.mark.parametrize(
    ("arguments", "code", "error"),
    [
        ([], 2, "say whose FPGA the design is for: --device with one of cubestar"),
        (["--device", "aramis"], 2, "aramis declares no contract for its FPGA; devices with one:"),
        (["--device", "cubestar", "-k", "x-y"], 2, "no test has 'x-y' in its name; tests: stores"),
        (["--device", "cubestar", "--gateware-param", "A"], 2, "takes NAME=VALUE, not 'A'"),
        (["missing.v", "--device", "cubestar"], 2, "missing.v"),
    ],
)
def test_wrong_calls_are_one_line(arguments: list[str], code: int, error: str, run: Run) -> None:
    outcome = run("hdl", "test", *arguments)
    assert (outcome.code, error in outcome.line) == (code, True)


def test_missing_simulator_is_one_line(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    monkeypatch.setattr(running.shutil, "which", lambda _: None)
    outcome = run("hdl", "test", "--device", "cubestar")
    assert outcome.code == 1
    assert "Icarus Verilog is not installed; try: apt-get install iverilog" in outcome.line
