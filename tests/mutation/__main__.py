"""Mutation testing: changes the Python code and counts changes that no test detects.

examples, from the project's folder:
  python -m tests.mutation --record                          which tests run which lines; once
  python -m tests.mutation --record-new                      add tests written since then
  python -m tests.mutation                                   40 mutants of all three parts
  python -m tests.mutation --count 400 --seed 7 --jobs 2
  python -m tests.mutation --folder firmware_model/cubestar

A mutant is killed if a test fails or times out. Its tests are those that run its line, or, without
a recorded run, those of the nearest files. Survivors are printed; some have no visible effect.
Exit status 1 if fewer than 90 % are killed.
"""

import argparse
import hashlib
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from tests.mutation.mutants import PARTS, Mutant, modules, mutants
from tests.mutation.reached import record
from tests.mutation.trial import ROOT, Copy, Suite

ENOUGH = 0.9


def chosen(folder: Path, seed: int) -> list[Mutant]:
    """All mutants in a random order, weighted by the lines of their modules.

    The order depends on the seed, the name of the module and the text of the mutant, so that it
    hardly changes when other code does.
    """
    drawn = list[tuple[float, Mutant]]()
    for path in modules(ROOT):
        if path.is_relative_to(folder):
            text, alike = (ROOT / path).read_text("utf-8"), Counter[str]()
            found = mutants(path, text)
            for mutant in found:
                change = f"{mutant.before} -> {mutant.after}"
                alike[change] += 1
                lot = hashlib.sha256(f"{seed} {path} {change} {alike[change]}".encode()).digest()
                share = (int.from_bytes(lot[:8]) + 1) / 2**64  # (Efraimidis and Spirakis)
                drawn.append((-math.log(share) * len(found) / text.count("\n"), mutant))
    return [mutant for _, mutant in sorted(drawn, key=lambda one: one[0])]


def results(tried: list[Mutant], jobs: int) -> Iterator[tuple[Mutant, bool]]:
    """Mutants and whether each was killed, in order; runs ``jobs`` copies in parallel."""
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        copies: Queue[Copy] = Queue()
        for job in range(jobs):
            copies.put(Copy(ROOT, Path(folder, str(job))))

        suite = Suite(copies.queue[0].collected)

        def one(mutant: Mutant) -> bool:
            copy = copies.get()
            try:
                return copy.killed(mutant, *suite.tests(mutant))
            finally:
                copies.put(copy)

        with ThreadPoolExecutor(jobs) as pool:
            yield from zip(tried, pool.map(one, tried), strict=True)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="mutation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=40, metavar="N", help="mutants; default 40")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the choice; default 1")
    parser.add_argument("--folder", type=Path, default=Path(), help="only what is below it")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="at the same time")
    parser.add_argument("--record", action="store_true", help="run all tests, see which run what")
    parser.add_argument("--record-new", action="store_true", help="run those not on record yet")
    args = parser.parse_args()
    for name in ("count", "jobs"):
        if getattr(args, name) < 1:
            parser.error(f"--{name} must be at least 1, not {getattr(args, name)}")
    if not any(path.is_relative_to(args.folder) for path in modules(ROOT)):
        parser.error(f"{args.folder} has no module; it is below {', '.join(PARTS)}")
    if args.record or args.record_new:
        return record(ROOT, new=args.record_new)
    facing = chosen(args.folder, args.seed)[: args.count]
    tried = survived = 0
    for mutant, killed in results(facing, args.jobs):
        tried, survived = tried + 1, survived + (not killed)
        if not killed:
            print(f"{tried:4} survived: {mutant}", flush=True)
    killed = tried - survived
    print(f"{killed} of {tried} killed: {killed / max(1, tried):.0%}")
    return 0 if tried and killed >= ENOUGH * tried else 1


if __name__ == "__main__":
    sys.exit(main())
