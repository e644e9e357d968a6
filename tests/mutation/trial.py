"""One mutant and its tests, in a copy of the project."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.mutation.mutants import Mutant
from tests.mutation.plugin import FAILED, PLUGIN
from tests.mutation.reached import collected

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
