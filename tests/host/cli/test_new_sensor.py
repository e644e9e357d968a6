"""`cubestack new-sensor`: what it writes, and what it refuses."""

import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.host.cli.new_sensor import rendered

from ...conftest import Run

MOST_LINES = 150


@pytest.mark.parametrize("name", ["glow", "m9_lux"])
def test_writes_a_small_folder_that_the_linter_passes(name: str, run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "sensor"
    outcome = run("new-sensor", name, "--out", folder)
    assert outcome.code == 0
    assert f"pip install --no-build-isolation -e {folder}" in outcome.out
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert {str(path.relative_to(folder)) for path in files} == {
        *("pyproject.toml", f"tests/test_{name}.py", f"{name}/__init__.py", f"{name}/sensor.py")
    }
    texts = [path.read_text(encoding="utf-8") for path in files]
    assert sum(len(text.splitlines()) for text in texts) <= MOST_LINES
    for command in (["check", "--select", "E,F,W,I,UP,B,SIM,RUF,C4,PT,N"], ["format", "--check"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--isolated", "--line-length", "100"]
        done = subprocess.run(ruff, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


def test_the_folder_is_named_after_the_sensor(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("new-sensor", "glow").code == 0
    assert (tmp_path / "glow-sensor" / "glow" / "sensor.py").exists()
    outcome = run("new-sensor", "glow")
    assert (outcome.code, outcome.line) == (
        2,
        "cubestack new-sensor: glow-sensor exists; remove it, or choose another with --out",
    )


def test_takes_an_address_that_no_device_has() -> None:
    assert "i2c_address=0x29" in dict(rendered("glow"))["glow/__init__.py"]
