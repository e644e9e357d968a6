"""`cubestack hdl test`."""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cubestack.firmware_model.values import whole
from cubestack.hdl.contract.contract import QUICK, TIERS, Contract
from cubestack.hdl.contract.points import Coverage
from cubestack.hdl.contract.running import Report, Result, junit, run_checks
from cubestack.host.cli.arguments import add_flag, add_output, add_value
from cubestack.host.cli.hdl.design import FILE, add_design, design_of
from cubestack.host.cli.hdl.wave import FOLDERS
from cubestack.host.output import output_folder, write_output
from cubestack.host.terminal import say, tell

NAME = "test"

HELP = "test a design of yours against a device's contract"

DESCRIPTION = """Test a design for a device's FPGA at its pins, with cocotb on Icarus Verilog:
a camera, an SRAM and a processor around the design. The contract allows a few
clocks of latency. Without FILE the shipped design is tested. Needs the extra
hdl and Icarus Verilog.

A design with parameters for the size of the image is tested with small images,
others at full size, which takes about a minute.

Exit status 1 if a test fails; the waveform of the first failure is kept.

examples:
  cubestack hdl test design.v --device DEVICE
  cubestack hdl test design.v:my_top --device DEVICE --tier full --seed 7
  cubestack hdl test my_module:MyTop --device DEVICE -k bank
  cubestack hdl test my_module:Binned --device DEVICE --image my_module
  cubestack hdl test --device DEVICE --junit out/contract.xml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", nargs="?", default="", help=FILE)
    add_design(parser)
    parser.add_argument(
        "--tier", choices=TIERS, default=QUICK, help="full: more sizes and seeds; default: quick"
    )
    parser.add_argument("-k", dest="text", metavar="TEXT", default="", help="part of tests' names")
    parser.add_argument(
        "--image",
        metavar="MODULE",
        default="",
        help="says what the design keeps of a frame (docs/how-to/change-the-gateware.md)",
    )
    add_value(parser, "seed", whole(0, "added to the seeds of all tests", 0))
    add_output(parser, "--junit", "write the results as JUnit's XML")
    parser.add_argument(
        "--waves",
        type=Path,
        metavar="DIR",
        default=FOLDERS[0],
        help="where the waveform of the first failure goes; default: %(default)s",
    )
    parser.add_argument(
        "--simulator", choices=("icarus", "verilator"), default="icarus", help="default: icarus"
    )
    add_flag(parser, "--json", "print JSON when all are done")


def run(args: argparse.Namespace) -> int:
    design = design_of(args, args.file, args.image)
    told = (lambda *_: None) if args.json else _tell
    report = run_checks(
        design,
        args.tier,
        seed=args.seed,
        text=args.text,
        waves=args.waves,
        simulator=args.simulator,
        told=told,
    )
    if args.junit:
        output_folder(args.junit.parent)
        write_output(args.junit, junit(report, design.contract))
    if args.json:
        print(json.dumps(_as_json(report, design.contract), indent=1))
    else:
        for line in _lines(report, design.contract):
            tell(line)
    return 1 if report.failed else 0


def _tell(name: str, done: int, total: int) -> None:
    say(f"{done} of {total} done  running {name}")


def _lines(report: Report, contract: Contract) -> Iterator[str]:
    yield f"{report.title}: contract of {contract.title}, tier {report.tier}, seed {report.seed}"
    width = max(len(result.name) for result in report.results)
    for result in report.results:
        outcome = "FAILED" if result.error else "passed"
        yield (
            f"  {outcome}  {result.name:<{width}}  {result.size}, seed {result.seed}, "
            f"{result.seconds:.1f} s"
        )
        if result.error:
            yield f"    {contract.checks[result.name].requirement}"
            yield f"    {result.error}"
    coverage = Coverage(contract.points)
    for line in coverage.table(report.reached):
        yield f"  {line}"
    failed = len(report.failed)
    yield f"{len(report.results) - failed} passed, {failed} failed"
    if report.waveform:
        yield f"waveform: {report.waveform}; look at it with: cubestack hdl wave {report.waveform}"


def _as_json(report: Report, contract: Contract) -> dict[str, Any]:
    missed = Coverage(contract.points).missed(report.reached)
    return {
        "design": report.title,
        "tier": report.tier,
        "seed": report.seed,
        "tests": [_one(result, contract) for result in report.results],
        "points": {
            "reached": sum(map(len, report.reached.values())),
            "missed": [[group, *point] for group, point in missed],
        },
        "waveform": report.waveform and str(report.waveform),
    }


def _one(result: Result, contract: Contract) -> dict[str, Any]:
    return {
        "name": result.name,
        "requirement": contract.checks[result.name].requirement,
        "columns": result.size.columns,
        "rows": result.size.rows,
        "seed": result.seed,
        "passed": not result.error,
        "error": result.error,
        "seconds": round(result.seconds, 3),
    }
