"""`cubestack hdl prove`."""

import argparse

from cubestack.hdl.proofs.prover import verdict_json, verdict_text, verdicts
from cubestack.host.cli.arguments import add_flag
from cubestack.host.cli.hdl.choice import chosen
from cubestack.host.terminal import progress, tell

NAME = "prove"

HELP = "prove properties of the designs"

DESCRIPTION = """Prove properties of the designs by induction: for any run time, any image and
any order of clock edges. Each proof then runs on a design with a planted bug,
which it must find. Needs the extra hdl; all proofs take one to two minutes.

Exit status 1 if a property is not proved or a planted bug is not found.

examples:
  cubestack hdl prove
  cubestack hdl prove sun-scan pair-drivers
  cubestack hdl prove --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", metavar="NAME", nargs="*", help="proofs; default: all")
    add_flag(parser, "--json", "print JSON when all are done")


def run(args: argparse.Namespace) -> int:
    proofs = chosen(args.proofs(), args.names, "proof")
    done = []
    for verdict in progress(verdicts(proofs), len(proofs), "proofs", quiet=args.json):
        done.append(verdict)
        if not args.json:
            tell(verdict_text(verdict))
    if args.json:
        print(verdict_json(done))
    return 0 if all(verdict.good for verdict in done) else 1
