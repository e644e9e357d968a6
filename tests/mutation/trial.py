"""One mutant and its tests, in a copy of the project."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

from tests.mutation.mutants import Mutant
from tests.mutation.plugin import FAILED, PLUGIN
from tests.mutation.reached import BUDGET_S, DOCUMENTS, Reached, collected

UNKNOWN_S = 600.0
"""The time that tests may take of which it is not known how long they take."""

SITE = """
import sys
from pathlib import Path
for name, module in list(sys.modules.items()):
    if name.startswith("__editable___cubestack"):
        for package in module.MAPPING:
            parts = package.split(".")[1:] or ["host", "api"]
            module.MAPPING[package] = str(Path({tree!r}, *parts))
"""
"""Makes the interpreter import the copy instead of the project that is installed."""


class Copy:
    """A copy of the project in ``root`` for one mutant at a time."""

    def __init__(self, root: Path, folder: Path) -> None:
        self._tree, self._failed = folder / "tree", folder / "failed"
        left_out = shutil.ignore_patterns(".*", "__pycache__", "build", "out")
        shutil.copytree(root, self._tree, ignore=left_out, symlinks=True)
        site = folder / "site"
        site.mkdir()
        text = SITE.format(tree=str(self._tree))
        (site / "sitecustomize.py").write_text(text, "utf-8")
        environment = {"PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": ""}
        environment[FAILED] = str(self._failed)
        self._environment = os.environ | environment
        self._writes = 0
        self._sound: dict[str, bool] = {}

    def collected(self) -> set[str]:
        """Tests of the copy, without those that need files beside the project."""
        return collected(self._tree, self._environment)

    def killed(self, mutant: Mutant, tests: list[str], limit_s: float) -> bool:
        """Whether a test that passes without the mutant fails with it."""
        target = self._tree / mutant.path
        original = target.read_text("utf-8")
        while tests:
            self._write(target, mutant.put_into(original))
            try:
                passed = self._pass(tests, limit_s)
            finally:
                self._write(target, original)
            if passed or not self._failed.exists():
                return not passed  # not in time, or not even imported
            failed = self._failed.read_text("utf-8")
            if failed not in self._sound:
                self._sound[failed] = self._pass([failed], UNKNOWN_S)
            if self._sound[failed]:
                return True
            tests = [test for test in tests if self._sound.get(test, True)] + [
                f"--deselect={failed}"
            ]
        return False

    def _write(self, target: Path, text: str) -> None:
        """Changes the file date as well, so that Python compiles it again."""
        target.write_text(text, "utf-8")
        self._writes += 1
        os.utime(target, (self._writes, self._writes))

    def _pass(self, tests: list[str], timeout_s: float) -> bool:
        self._failed.unlink(missing_ok=True)
        call = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", PLUGIN]
        call += ["-p", "no:unraisableexception"]  # of whatever was imported, at the first test
        nothing = subprocess.DEVNULL
        with subprocess.Popen(
            [*call, *tests],
            cwd=self._tree,
            env=self._environment,
            stdout=nothing,
            stderr=nothing,
            start_new_session=True,  # so that it ends with all that it has started
        ) as process:
            try:
                return process.wait(timeout_s) == 0
            except subprocess.TimeoutExpired:
                return False
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, 9)


ROOT = Path(__file__).parents[2]
MOST_FILES = 6
"""Test files of a module; the nearest ones."""

LEAST_S, SLOWER = 30.0, 3.0
"""The time that tests may take: that to begin, and so much longer than without a mutant."""


class Suite:
    """Selects tests of a mutant among those ``present`` in a copy."""

    def __init__(self, present: Callable[[], set[str]]) -> None:
        self._reached: Reached | None = None
        self._new: list[str] = []
        try:
            self._reached = Reached(ROOT)
        except FileNotFoundError:
            return
        self._new = self._reached.update(present())

    def tests(self, mutant: Mutant) -> tuple[list[str], float]:
        """Arguments for pytest, and its time limit in seconds."""
        if self._reached:
            files = {str(file) for file in files_for(mutant.path)}
            recorded, new = self._reached.tests(mutant, files), near(mutant.path, self._new)
            known_s = sum(map(self._reached.durations.__getitem__, recorded))
            if recorded or new:
                return new + recorded, LEAST_S + SLOWER * (known_s + BUDGET_S * bool(new))
        return [str(file) for file in files_for(mutant.path)], UNKNOWN_S


def near(path: Path, tests: list[str]) -> list[str]:
    """Tests in the files for a module, and those that compare tables with documents."""
    files = {*DOCUMENTS, *map(str, _ranked(path))}
    return [test for test in tests if test.partition("::")[0] in files]


def files_for(path: Path) -> list[Path]:
    """Test files for a module: its mirror image first, then the nearest of those that stand beside
    it or import it."""
    return _ranked(path)[:MOST_FILES]


@cache
def _ranked(path: Path) -> list[Path]:
    folder, own = Path("tests") / path.parent, f"test_{path.stem}.py"
    if path.stem == "__init__":
        folder, own = folder.parent, f"test_{path.parent.name}.py"
    package = path.parent if path.stem == "__init__" else path.with_suffix("")
    imported = "cubestack." + ".".join(package.parts)
    ranked = []
    for file, text in _test_texts():
        mirror = file == folder / own
        beside = file.parent == folder
        if mirror or beside or f"from {imported} import" in text or f"import {imported}" in text:
            shared = len(os.path.commonpath([file.parent, folder]).split(os.sep))
            ranked.append((not mirror, -shared, f"{imported} import" not in text, file))
    while not ranked and folder != Path("tests"):
        folder = folder.parent
        ranked = [(True, True, 0, file) for file, _ in _test_texts() if file.parent == folder]
    return [file for *_, file in sorted(ranked)]


@cache
def _test_texts() -> list[tuple[Path, str]]:
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    return [(file.relative_to(ROOT), file.read_text("utf-8")) for file in files]
