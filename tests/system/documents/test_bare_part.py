"""docs/how-to/bare-part.md, pasted line by line in an empty folder beside the project."""

import shutil
import sys
from pathlib import Path

import pytest

from tests.emulator.boards.efm32gg.programs import needs_both_compilers

from .blocks import ROOT
from .pasted import Pasted, pasted

pytestmark = [*needs_both_compilers, pytest.mark.slow]

PAGE = ROOT / "docs" / "how-to" / "bare-part.md"
INSTALLED = ("python3 -m venv", ". .venv/bin", "pip install")
"""Commands of an installation, which the tests have already."""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Pasted]:
    base = tmp_path_factory.mktemp("reader")
    example = base / "cubestack" / "examples" / "bare_part"
    built = shutil.ignore_patterns("*.elf", "processor.h", "__pycache__")
    shutil.copytree(ROOT / "examples" / "bare_part", example, ignore=built)
    folder = base / "empty"
    (folder / ".venv" / "bin").mkdir(parents=True)
    (folder / ".venv" / "bin" / "activate").write_text("")
    ready = [f"export PATH={Path(sys.executable).parent}:$PATH", "python3() { :; }; pip() { :; }"]
    found = pasted(PAGE, folder, long=False, limit_s=120.0, ready=ready)
    return {one.line: one for one in found}


def line(done: dict[str, Pasted], part: str) -> Pasted:
    (found,) = (one for text, one in done.items() if part in text)
    return found


def test_every_command_runs(done: dict[str, Pasted]) -> None:
    assert len(done) >= 9
    assert not [str(one) for one in done.values() if one.code != 0]  # nothing is left out


def test_output_is_as_described(done: dict[str, Pasted]) -> None:
    said = line(done, "head -n 1").said
    assert said == "off" or (said and "ready".endswith(said))  # what was sent before, or its end
    assert line(done, "--semihosting").said.endswith("exited by semihosting with status 0")
    assert line(done, "--stimulus").said == "ended by the time-out"
    assert "5 passed" in line(done, "pytest --").said
