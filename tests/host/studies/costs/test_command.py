import json
import shutil

import pytest

from tests.conftest import Run

COMPILER = "arm-none-eabi-gcc"


@pytest.mark.parametrize(
    ("option", "value", "known"),
    [("--level", "O9", "O0, O2, Os"), ("--precision", "half", "own, float, literals, double")],
)
def test_rejects_unknown_builds_in_one_line(run: Run, option: str, value: str, known: str) -> None:
    outcome = run("costs", "measure", option, value)
    assert outcome.code == 2
    assert outcome.line == f"cubestack costs: {option} must be one of {known}, not {value}"


def test_missing_compiler_names_the_package(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    from cubestack.emulator.boards.cubestar.compiled import build

    build.compiler_version.cache_clear()
    monkeypatch.setattr(shutil, "which", lambda _program: None)
    outcome = run("costs", "measure", "--level", "O2")
    assert outcome.code == 1
    assert outcome.line.startswith("cubestack costs: arm-none-eabi-gcc is not installed: apt ")


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}")
def test_measures_a_build(run: Run) -> None:
    outcome = run("costs", "measure", "--level", "Os", "--precision", "own", "--json")
    (build,) = json.loads(outcome.out)["builds"]
    assert build["build"] == "-Os own"
    assert build["operations"]["f32_acos"] > 20 * build["operations"]["f32_mul"] > 0
    assert sum(build["phases"].values()) > 1_000_000
