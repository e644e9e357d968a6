"""The tests that a mutant has to face."""

import os
from functools import cache
from pathlib import Path

from tests.mutation.mutants import Mutant
from tests.mutation.reached import Reached
from tests.mutation.trial import UNKNOWN_S

ROOT = Path(__file__).parents[2]
MOST_FILES = 6
"""Test files of a module; the nearest ones."""

LEAST_S, SLOWER = 30.0, 3.0
"""The time that tests may take: that to begin, and so much longer than without a mutant."""


class Suite:
    """Chooses the tests that a mutant has to face."""

    def __init__(self) -> None:
        try:
            self._reached: Reached | None = Reached(ROOT)
        except FileNotFoundError:
            self._reached = None

    def tests(self, mutant: Mutant) -> tuple[list[str], float]:
        """Arguments for pytest, and the seconds that it may take."""
        if self._reached and (found := self._reached.tests(mutant)):
            return found, LEAST_S + SLOWER * sum(map(self._reached.durations.get, found))
        return [str(file) for file in files_for(mutant.path)], UNKNOWN_S


def files_for(path: Path) -> list[Path]:
    """Test files for a module: its mirror image first, then who imports it, the nearest first."""
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
            ranked.append((not mirror, f"{imported} import" not in text, -shared, file))
    while not ranked and folder != Path("tests"):
        folder = folder.parent
        ranked = [(True, True, 0, file) for file, _ in _test_texts() if file.parent == folder]
    return [file for *_, file in sorted(ranked)[:MOST_FILES]]


@cache
def _test_texts() -> list[tuple[Path, str]]:
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    return [(file.relative_to(ROOT), file.read_text("utf-8")) for file in files]
