import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.forked import forked, of_pytest
from tests.system.conftest import ROOT, Served

TEXT = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SERVES = "cubestack emulate "
SOON_S = 120

pytestmark = pytest.mark.xdist_group("tutorial")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the tutorial only."""
    made = tmp_path_factory.mktemp("newcomer")
    for kind, block in BLOCK.findall(TEXT):
        if kind == "python":
            first, _, rest = block.partition("\n")
            (made / first.removeprefix("# ")).write_text(rest, encoding="utf-8")
    return made


def environment() -> dict[str, str]:
    """A shell environment with the installed packages."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    return own | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


def commands() -> list[str]:
    return [
        line for kind, block in BLOCK.findall(TEXT) if kind == "sh" for line in block.split("\n")
    ]


@pytest.fixture
def sensor(folder: Path) -> Iterator[None]:
    (line,) = (one for one in commands() if one.startswith(SERVES))
    with Served(line.removeprefix(SERVES).split(), folder):
        yield


def done(line: str, folder: Path) -> str:
    finished = subprocess.run(
        *(line.split(),),
        **{"cwd": folder, "env": environment(), "timeout": SOON_S},
        **{"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True},
    )
    assert finished.returncode == 0, finished.stdout
    return str(finished.stdout)


def test_all_commands_are_tested() -> None:
    assert commands() == [
        *("python3 -m venv .venv", ". .venv/bin/activate", "pip install ../cubestack pytest", ""),
        *("cubestack measure cubesense --frames 3 --profile extended", ""),
        *("cubestack emulate cubesense --profile extended --pty ./ttyCUBESENSE", ""),
        *("python sunsensor.py ./ttyCUBESENSE", "", "pytest test_sunsensor.py", ""),
    ]


def test_tutorial_measure_command_runs(run: Run) -> None:
    assert "nadir" in run(*["measure", "cubesense", "--frames", "3", "--profile", "extended"]).out


def test_driver_prints_the_documented_angles(folder: Path, sensor: None) -> None:
    told = done("python sunsensor.py ./ttyCUBESENSE", folder)
    numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", told)]
    assert numbers == pytest.approx([20, 10, -8, 12], abs=0.2)


@pytest.mark.slow
def test_driver_tests_pass_and_detect_a_missing_retry(folder: Path, tmp_path: Path) -> None:
    assert "4 passed" in said_by_pytest(folder)
    worse = tmp_path / "worse"
    shutil.copytree(folder, worse, ignore=shutil.ignore_patterns("__pycache__", "tty*"))
    driver = worse / "sunsensor.py"
    driver.write_text(driver.read_text().replace("range(attempts)", "range(1)"))
    said = said_by_pytest(worse)
    assert "1 failed, 3 passed" in said
    assert "emulated cubesense" in said


def said_by_pytest(folder: Path) -> str:
    """What the documented pytest prints there."""
    (words,) = (line.split()[1:] for line in commands() if line.startswith("pytest "))
    return forked(of_pytest(*words), folder=folder, environment=environment()).out
