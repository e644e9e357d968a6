"""`cubestack hdl prove`."""

import argparse
import json
from pathlib import Path

from cubestack.hdl.contract.crossings import Crossing, crossings
from cubestack.hdl.contract.proving import Verdict, properties_of, prove_contract
from cubestack.hdl.proofs.counterexample import FOLDER, Counterexample, write_vcd
from cubestack.hdl.proofs.prover import counterexample_text, verdict_json, verdict_text, verdicts
from cubestack.host.cli.arguments import add_flag
from cubestack.host.cli.hdl.choice import chosen
from cubestack.host.cli.hdl.design import FILE, add_design, design_of
from cubestack.host.terminal import progress, tell

NAME = "prove"

HELP = "prove properties of the designs"

DESCRIPTION = """Prove properties of the shipped designs by induction: for any run time, any
image and any order of clock edges. Each proof then runs on a design with a
planted bug, which it must find. Needs the extra hdl; all proofs take one to two
minutes.

With --device: prove the device's contract at the pins of a design of yours, or
of the shipped one without FILE. Each property is proved for any run time,
holds for a number of clocks from power-up, or is refuted. Then the netlist is
searched for registers that sample an asynchronous signal.

A refuted property is shown with its counterexample: the pins step by step, and
a waveform that `cubestack hdl wave` shows.

Exit status 1 if a shipped design's property is not proved, a planted bug is not
found, or a property of your design is refuted.

examples:
  cubestack hdl prove
  cubestack hdl prove sun-scan pair    sun-scan, and all that start with pair
  cubestack hdl prove --json
  cubestack hdl prove design.v --device DEVICE
  cubestack hdl prove design.v --device DEVICE -k ack    one property"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "names", metavar="NAME|FILE", nargs="*", help=f"proofs, or their first letters; or {FILE}"
    )
    add_design(parser)
    parser.add_argument("-k", dest="text", metavar="TEXT", help="first letters of a property")
    add_flag(parser, "--json", "print JSON when all are done")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=FOLDER,
        help="where waveforms of counterexamples go; default: %(default)s",
    )


def run(args: argparse.Namespace) -> int:
    return _shipped(args) if args.device is None else _contract(args)


def _contract(args: argparse.Namespace) -> int:
    if len(args.names) > 1:
        raise ValueError(f"--device takes one FILE, not {len(args.names)}")
    design = design_of(args, *(args.names or [""]))
    properties = properties_of(design, args.text or "")
    found = []
    for verdict in progress(
        prove_contract(design, properties), len(properties), "properties", quiet=args.json
    ):
        found.append(verdict)
        if not args.json:
            tell(f"{verdict.name}: {verdict.requirement}")
            tell(f"  {verdict.outcome}; {verdict.size} pixels, {verdict.seconds:.1f} s")
        if verdict.shown:
            _keep(args, verdict.name, verdict.shown)
    searched = not args.text and bool(design.contract.inputs)
    crossed = crossings(design) if searched else []
    if args.json:
        print(json.dumps(_as_json(found, crossed), indent=1))
    elif searched:
        tell("crossings: No register samples an asynchronous signal without a synchroniser")
        for crossing in crossed:
            tell(f"  VIOLATED: {crossing}")
        if not crossed:
            tell("  true of the netlist")
    return 1 if crossed or any(verdict.shown for verdict in found) else 0


def _keep(args: argparse.Namespace, name: str, shown: Counterexample) -> None:
    path = args.out / f"{name}.vcd"
    write_vcd(path, name, shown)
    if not args.json:
        for line in counterexample_text(shown):
            tell(line)
        tell(f"  waveform: {path}; look at it with: cubestack hdl wave {path}")


def _as_json(verdicts: list[Verdict], crossed: list[Crossing]) -> dict[str, object]:
    return {
        "properties": {
            verdict.name: {
                "property": verdict.requirement,
                "outcome": verdict.outcome,
                "proved": verdict.proved,
                "steps": verdict.steps,
                "violated": verdict.shown.violated if verdict.shown else [],
                "seconds": round(verdict.seconds, 3),
            }
            for verdict in verdicts
        },
        "crossings": [str(crossing) for crossing in crossed],
    }


def _shipped(args: argparse.Namespace) -> int:
    proofs = chosen(args.proofs(), args.names, "proof")
    done = []
    for verdict in progress(verdicts(proofs), len(proofs), "proofs", quiet=args.json):
        done.append(verdict)
        if not args.json:
            tell(verdict_text(verdict))
        if verdict.result.shown:
            _keep(args, verdict.name, verdict.result.shown)
    if args.json:
        print(verdict_json(done))
    return 0 if all(verdict.good for verdict in done) else 1
