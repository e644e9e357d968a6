"""How good are the tests? Wrong lines are put into the Python code, and those counted that pass.

examples, from the project's folder:
  python -m tests.mutation                                   40 mutants of all three parts
  python -m tests.mutation --count 20 --seed 7
  python -m tests.mutation --folder firmware_model/cubestar

A mutant is killed when a test fails, or when the tests do not end in time. Survivors are printed;
some change nothing that can be seen. Exit code 1 when fewer than 80 % are killed.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.mutation.mutants import PARTS, Mutant, modules, mutants

ROOT = Path(__file__).parents[2]
ENOUGH = 0.8
MOST_FILES = 6
"""Test files of a module; the nearest ones."""

LEAST_S, SLOWER = 60.0, 4.0
"""The time that tests may take: so much longer than without a mutant, and so much at least."""

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


class Copy:
    """A copy of the project that mutants are put into, one at a time."""

    def __init__(self, folder: Path) -> None:
        self.tree = folder / "tree"
        left_out = shutil.ignore_patterns(".*", "__pycache__", "build", "out")
        shutil.copytree(ROOT, self.tree, ignore=left_out, symlinks=True)
        site = folder / "site"
        site.mkdir()
        text = SITE.format(tree=str(self.tree))
        (site / "sitecustomize.py").write_text(text, "utf-8")
        self._environment = os.environ | {"PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}
        self._normal_s: dict[Path, float | None] = {}

    def limit_s(self, path: Path) -> float | None:
        """What a module's tests may take; None where they fail, or there are none, without it."""
        if path not in self._normal_s:
            started = time.monotonic()
            passed = self._pass(files_for(path), timeout_s=10 * LEAST_S)
            self._normal_s[path] = time.monotonic() - started if passed else None
        normal_s = self._normal_s[path]
        return None if normal_s is None else max(LEAST_S, SLOWER * normal_s)

    def survives(self, mutant: Mutant, limit_s: float) -> bool:
        """Whether its module's tests pass with it."""
        target = self.tree / mutant.path
        original = target.read_text("utf-8")
        target.write_text(mutant.put_into(original), "utf-8")
        try:
            return self._pass(files_for(mutant.path), timeout_s=limit_s)
        finally:
            target.write_text(original, "utf-8")

    def _pass(self, files: list[Path], timeout_s: float) -> bool:
        if not files:
            return False
        call = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *files]
        nothing = subprocess.DEVNULL
        with subprocess.Popen(
            call,
            cwd=self.tree,
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


def chosen(folder: Path, seed: int) -> Iterator[Mutant]:
    """Without an end: a module by its number of lines, then one of its mutants, each once."""
    random_ = random.Random(seed)
    texts = {p: (ROOT / p).read_text("utf-8") for p in modules(ROOT) if p.is_relative_to(folder)}
    left = {path: mutants(path, text) for path, text in texts.items()}
    while left := {path: found for path, found in left.items() if found}:
        paths = list(left)
        (path,) = random_.choices(paths, [texts[p].count("\n") for p in paths])
        yield left[path].pop(random_.randrange(len(left[path])))


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="mutation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=40, metavar="N", help="mutants; default 40")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the choice; default 1")
    parser.add_argument("--folder", type=Path, default=Path(), help="only what is below it")
    args = parser.parse_args()
    if args.count < 1:
        parser.error(f"--count must be at least 1, not {args.count}")
    if not any(path.is_relative_to(args.folder) for path in modules(ROOT)):
        parser.error(f"{args.folder} has no module; it is below {', '.join(PARTS)}")
    tried = survived = 0
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        copy = Copy(Path(folder))
        for mutant in chosen(args.folder, args.seed):
            if tried == args.count:
                break
            limit_s = copy.limit_s(mutant.path)
            if limit_s is None:
                print(f"not tried, its tests do not pass: {mutant}", flush=True)
                continue
            alive = copy.survives(mutant, limit_s)
            tried, survived = tried + 1, survived + alive
            if alive:
                print(f"survived: {mutant}", flush=True)
    killed = tried - survived
    print(f"{killed} of {tried} killed: {killed / max(1, tried):.0%}")
    return 0 if tried and killed >= ENOUGH * tried else 1


if __name__ == "__main__":
    sys.exit(main())
