"""Selects the tests of a mutant."""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

from tests.mutation.mutants import Mutant
from tests.mutation.reached import BUDGET_S, DOCUMENTS, Reached
from tests.mutation.trial import UNKNOWN_S

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
