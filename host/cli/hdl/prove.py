"""`cubestack hdl prove`."""

import argparse
from pathlib import Path

from cubestack.hdl.proofs.counterexample import FOLDER, write_vcd
from cubestack.hdl.proofs.prover import verdict_json, verdict_text, verdicts
from cubestack.host.cli.arguments import add_flag
from cubestack.host.cli.hdl.choice import chosen
from cubestack.host.terminal import progress, tell

NAME = "prove"

HELP = "prove properties of the designs"

DESCRIPTION = """Prove properties of the designs by induction: for any run time, any image and
any order of clock edges. Each proof then runs on a design with a planted bug,
which it must find. Needs the extra hdl; all proofs take one to two minutes.

A refuted property is shown with its counterexample: the pins step by step, and
a waveform that `cubestack hdl wave` shows.

Exit status 1 if a property is not proved or a planted bug is not found.

examples:
  cubestack hdl prove
  cubestack hdl prove sun-scan pair    sun-scan, and all that start with pair
  cubestack hdl prove --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", metavar="NAME", nargs="*", help="proofs, or their first letters")
    add_flag(parser, "--json", "print JSON when all are done")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=FOLDER,
        help="where waveforms of counterexamples go; default: %(default)s",
    )


def run(args: argparse.Namespace) -> int:
    proofs = chosen(args.proofs(), args.names, "proof")
    done = []
    for verdict in progress(verdicts(proofs), len(proofs), "proofs", quiet=args.json):
        done.append(verdict)
        if not args.json:
            tell(verdict_text(verdict))
        if shown := verdict.result.shown:
            path = args.out / f"{verdict.name}.vcd"
            write_vcd(path, verdict.name, shown)
            if not args.json:
                tell(f"  waveform: {path}; look at it with: cubestack hdl wave {path}")
    if args.json:
        print(verdict_json(done))
    return 0 if all(verdict.good for verdict in done) else 1
