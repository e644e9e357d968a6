"""Which tests run a line and how long they take, from one recorded run."""

import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Set
from functools import cached_property
from pathlib import Path

from coverage import CoverageData

from tests.mutation.mutants import PARTS, Mutant
from tests.mutation.plugin import COLLECTED, DURATIONS, KNOWN, PLUGIN, without_group

FOLDER = Path("out/mutation")
DATA, TIMES, SETTINGS = "coverage.data", "durations.json", "coverage.ini"
BUDGET_S, MOST_TESTS = 25.0, 250
"""Limits of the tests per mutant: seconds, and their number, without those of `DOCUMENTS`."""

SITE = """
import os
if test := os.environ.get("PYTEST_CURRENT_TEST"):
    import atexit
    import coverage
    recorded = coverage.Coverage(
        {data!r}, True, config_file=False, source={source!r}, context=test, messages=False
    )
    recorded.set_option("run:disable_warnings", ["no-data-collected", "module-not-imported"])
    recorded.start()
    atexit.register(lambda: (recorded.stop(), recorded.save()))
"""
"""Makes interpreters that a test starts record what they run, in its name."""

OWN_S = 10.0
"""Of a module's own test file all tests come first, the quickest, until they take so long."""

AT_ONCE = 40
"""Tests of another file beside its own for each one of the others: what is declared in it, all
commands run, and few look at.
"""

DOCUMENTS = (
    "tests/system/documents/test_pages.py",
    "tests/system/documents/test_protocol_pages.py",
    "tests/host/export/test_interface.py",
)
"""They compare tables with the documents, and need not run a line for it."""


def record(root: Path, *, new: bool = False) -> int:
    """Run all tests of the project in ``root`` under coverage.py; pytest's exit status.

    Or only those that are ``new``, and add them to what is on record.
    """
    folder = root / FOLDER
    site = folder / "site"
    site.mkdir(parents=True, exist_ok=True)
    source = [str(root / part) for part in PARTS]
    text = SITE.format(data=str(folder / DATA), source=source)
    (site / "sitecustomize.py").write_text(text, "utf-8")
    (folder / SETTINGS).write_text(
        f"[run]\nrelative_files = true\ndata_file = {folder / DATA}\n"
        "disable_warnings = no-data-collected, module-not-imported\n",
        "utf-8",
    )
    call = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "--dist", "loadgroup"]
    call += ["-p", PLUGIN, f"--cov-config={folder / SETTINGS}"]
    call += [*(f"--cov={part}" for part in PARTS), "--cov-context=test", "--cov-report="]
    environment = os.environ | {DURATIONS: str(folder / TIMES), "PYTHONPATH": str(site)}
    if new:
        call += ["--cov-append"]
        environment |= {KNOWN: str(folder / TIMES)}
    return subprocess.call(call, cwd=root, env=environment)


def collected(root: Path, environment: Mapping[str, str]) -> set[str]:
    """Tests in ``root``, without files that can not be imported."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        names = Path(folder, "names.json")
        call = [sys.executable, "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider"]
        subprocess.run(
            [*call, "-p", PLUGIN],
            cwd=root,
            env={**environment, COLLECTED: str(names)},
            stdout=subprocess.DEVNULL,
            check=False,
        )
        return set(json.loads(names.read_text("utf-8")))


class Reached:
    """A recorded run; FileNotFoundError if there is none."""

    def __init__(self, root: Path) -> None:
        self._folder = root / FOLDER
        self.durations: dict[str, float] = json.loads((self._folder / TIMES).read_text("utf-8"))
        self._lines: dict[Path, dict[int, list[str]]] = {}

    def update(self, present: Set[str]) -> list[str]:
        """Removes tests that are not ``present``; returns the unrecorded ones."""
        new = sorted(present - self.durations.keys())
        self.durations = {test: self.durations[test] for test in self.durations.keys() & present}
        return new

    @cached_property
    def _data(self) -> CoverageData:
        data = CoverageData(str(self._folder / DATA))
        data.read()
        return data

    def tests(self, mutant: Mutant, files: Set[str]) -> list[str]:
        """Those that run its line: of each file the quickest, of those beside it some, the nearest
        file first, then the next of each. Where it runs when it is imported, those of `DOCUMENTS`,
        and those of its module and of the ``files`` that are about it."""
        if mutant.path not in self._lines:
            self._lines[mutant.path] = self._data.contexts_by_lineno(str(mutant.path))
        by_line = self._lines[mutant.path]
        # Of a statement over several lines, Python reports some only.
        lines = range(mutant.statement, mutant.end + 1)
        contexts = {context for line in lines for context in by_line.get(line, ())}
        found = _names(contexts)
        documents: list[str] = []
        if "" not in contexts:
            found |= _names_of_processes(contexts)
        if "" in contexts or not found:  # when it is imported, as all processes do
            found = _names(context for each in by_line.values() for context in each)
            found |= {test for test in self.durations if test.partition("::")[0] in files}
            documents = [test for test in self.durations if test.partition("::")[0] in DOCUMENTS]
        spent, taken = 0.0, []
        for test in self._in_turn(mutant.path, (found & self.durations.keys()) - {*documents}):
            spent += self.durations[test]
            if taken and (spent > BUDGET_S or len(taken) == MOST_TESTS):
                break
            taken.append(test)
        return taken + documents

    def _in_turn(self, path: Path, tests: set[str]) -> list[str]:
        own = Path("tests") / path.parent
        mirror = own / f"test_{path.stem}.py"
        by_file: dict[str, list[str]] = defaultdict(list)
        first: list[str] = []
        spent = 0.0
        for test in sorted(tests, key=lambda test: (self.durations[test], test)):
            file = test.partition("::")[0]
            if Path(file) == mirror and (spent := spent + self.durations[test]) < OWN_S:
                first.append(test)
            else:
                by_file[file].append(test)

        def distance(file: str) -> tuple[int, float, str]:
            shared = len(os.path.commonpath([Path(file).parent, own]).split(os.sep))
            return -shared, self.durations[by_file[file][0]], file

        order = {file: place for place, file in enumerate(sorted(by_file, key=distance))}
        turns = [
            (turn // AT_ONCE if Path(file).parent == own else turn, order[file], turn, test)
            for file, found in by_file.items()
            for turn, test in enumerate(found)
        ]
        return first + [test for *_, test in sorted(turns)]


def _names(contexts: Iterable[str]) -> set[str]:
    """Test names of contexts, which end with the phase; imports have no name."""
    return {without_group(context.rpartition("|")[0]) for context in contexts} - {""}


def _names_of_processes(contexts: Iterable[str]) -> set[str]:
    """Names of tests that started a process, with the phase in brackets."""
    return {without_group(context.rpartition(" (")[0]) for context in contexts} - {""}
