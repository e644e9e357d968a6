"""Mutation score of the testbenches: how many wrong gates they notice.

examples, from the project's folder:
  python -m tests.hdl.mutants                                all tops, 120 mutants of each
  python -m tests.hdl.mutants cubestar --count 20 --seed 7
  python -m tests.hdl.mutants cubesense-pair --all           hours; the same command goes on
  python -m tests.hdl.mutants --json

Exit status 1 when fewer than 95 % of the mutants that are not equivalent are killed.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, SpinnerColumn
from rich.table import Table

from tests.hdl.mutants.scoring import SUITES, Result, Score, Scoring

ENOUGH = 0.95
FOLDER = Path(__file__).parents[3] / "out" / "mutants"
TOPS = [name for name in SUITES if name.startswith("cube")]

errors = Console(stderr=True)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="mutants", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", metavar="NAME", nargs="*", help="default: all tops")
    number = parser.add_mutually_exclusive_group()
    number.add_argument("--count", type=int, default=120, metavar="N", help="mutants; default 120")
    number.add_argument("--all", action="store_true", help="every mutant that there is")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the choice; default 1")
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="FOLDER", help="of results")
    parser.add_argument(
        "--no-proofs", action="store_true", help="simulate only: what is equivalent survives"
    )
    parser.add_argument("--json", action="store_true", help="as JSON")
    args = parser.parse_args()
    for name in args.names:
        if name not in SUITES:
            parser.error(f"{name!r} has no mutants; there are {', '.join(SUITES)}")
    if args.count < 1:
        parser.error(f"--count must be at least 1, not {args.count}")
    return args


def score(name: str, args: argparse.Namespace) -> list[Result]:
    options = {"count": None if args.all else args.count, "proofs": not args.no_proofs}
    scoring = Scoring(name, SUITES[name], args.out, seed=args.seed, **options)
    results = []
    columns = [SpinnerColumn(), *Progress.get_default_columns()]
    with Progress(*columns, console=errors, disable=not errors.is_terminal, transient=True) as bar:
        task = bar.add_task(name, total=len(scoring.mutants))
        for result in scoring.results():
            results.append(result)
            bar.advance(task)
            if result.outcome == "survived" and not args.json:
                errors.print(f"{name}: survived: {result.mutant}", markup=False, highlight=False)
    return results


def table(scores: dict[str, Score]) -> Table:
    made = Table("top", "mutants", "killed", "equivalent", "survived", "score")
    for name, found in scores.items():
        made.add_row(name, str(sum(found)), *map(str, found), f"{found.share:.1%}")
    return made


def main() -> int:
    args = arguments()
    results = {name: score(name, args) for name in args.names or TOPS}
    scores = {
        name: Score(*(sum(r.outcome == kind for r in found) for kind in Score._fields))
        for name, found in results.items()
    }
    if args.json:
        report = {
            name: {
                **found._asdict(),
                "share": round(found.share, 4),
                "results": [asdict(result) for result in results[name]],
            }
            for name, found in scores.items()
        }
        print(json.dumps(report, indent=1))
    else:
        Console().print(table(scores))
    return 0 if all(found.share >= ENOUGH for found in scores.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
