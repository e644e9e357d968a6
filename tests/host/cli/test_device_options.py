"""Option --faults: the plan acts, and what is wrong with it is one line."""

import json
from pathlib import Path

import pytest

from cubestack.emulator.rtl.cxxrtl.build import find_compiler
from cubestack.host.cli.main import main

LATCH_UP = "[[fault]]\nkind = 'latch-up'\nat = 0.3\n"


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_measure_follows_the_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(LATCH_UP + "target = 'imager'\n")
    call = ["measure", "cubestar", "--mag-limit", "3.8", "--frames", "2", "--json"]
    assert main([*call, "--faults", str(plan)]) == 0
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert frames[0]["status"].startswith("capture_failed OverCurrent")
    assert frames[1]["status"] == "calculated"


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LATCH_UP + "target = 'radio'\n", "fault 1: latch-up: no supply channel 'radio'; there"),
        ("[[fault]]\nkind = 'smoke'\n", "fault 1: no fault 'smoke'; there are uart-drop"),
    ],
)
def test_a_wrong_plan_is_a_wrong_call(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    assert main(["measure", "cubesense", "--frames", "1", "--faults", str(plan)]) == 2
    errors = capsys.readouterr().err
    assert errors.splitlines()[-1].startswith(f"cubestack measure: {plan}: {message}")
