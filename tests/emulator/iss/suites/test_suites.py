"""Other people's test suites of the C library and of the compiler, run on the bare part.

Their sources come from Debian's packages, and DejaGnu judges them. ``make test-suites``
installs both and runs all programs, with EVERY=20 one in 20 files of the compiler's suite.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from tests.emulator.iss.cross_compiler import needs_compiler

from .dejagnu import GCC, NEWLIB, Suite, run_suite, running_service

EVERY = int(os.environ.get("CUBESTACK_SUITES", "0"))
SEED = int(os.environ.get("CUBESTACK_SUITES_SEED", "1"))
MOST_FAILED = 0.01
"""Part of the programs that fit."""

OWN_SUITE = """
load_lib passfail.exp
newlib_pass_fail_all -x {}
"""
PROGRAMS = {
    "passes": "int main(void) { return 0; }",
    "aborts": "#include <stdlib.h>\nint main(void) { abort(); }",
    "stack": "int main(void) { volatile char much[200000]; much[0] = 1; return much[0] - 1; }",
    "memory": "char much[200000]; int main(void) { return much[5]; }",
    "library": "int no_such_function(void); int main(void) { return no_such_function(); }",
}

pytestmark = [
    pytest.mark.slow,
    needs_compiler,
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    pytest.mark.skipif(shutil.which("runtest") is None, reason="dejagnu is not installed"),
]


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    with running_service(tmp_path_factory.mktemp("service")) as found:
        yield found


@pytest.mark.skipif(not EVERY, reason="make test-suites runs them")
@pytest.mark.parametrize("suite", [NEWLIB, GCC], ids=lambda suite: suite.tool)
def test_programs_that_fit_pass(suite: Suite, environment: dict[str, str], tmp_path: Path) -> None:
    if suite.archive() is None:
        pytest.skip(f"{suite.package} is not installed")
    sources = suite.unpack(tmp_path)
    every = EVERY if suite is GCC else 1
    found = run_suite(suite, sources, tmp_path / "run", environment, every=every, seed=SEED)
    print(f"{suite.package}, one in {every} files: {found}")
    assert found.passed
    assert len(found.failed) <= MOST_FAILED * (found.passed + len(found.failed)), str(found)


def test_programs_are_judged_by_how_they_end(environment: dict[str, str], tmp_path: Path) -> None:
    if NEWLIB.archive() is None:
        pytest.skip(f"{NEWLIB.package} is not installed")
    sources = NEWLIB.unpack(tmp_path)
    for folder in sources.glob("newlib.*"):
        shutil.rmtree(folder)
    (sources / "newlib.own").mkdir()
    (sources / "newlib.own" / "own.exp").write_text(OWN_SUITE)
    for name, program in PROGRAMS.items():
        (sources / "newlib.own" / f"{name}.c").write_text(program + "\n")
    found = run_suite(NEWLIB, sources, tmp_path / "run", environment, every=1, seed=SEED)
    assert found.passed == 1
    assert found.failed == ["FAIL newlib.own/aborts.c execution"]
    assert found.misfits == {
        "needs a stack larger than RAM": 1,
        "needs more memory than the part has": 1,
        "needs what the installed library lacks": 1,
    }
