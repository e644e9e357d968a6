"""Check a device's protocol against the interface tables, emulated or real.

Walks every telemetry frame, telecommand, register and bench letter, and every
error path. Without --allow-write it changes nothing and sends no telecommand.
Exit status: 0 all checks passed, 1 a check failed or differs.

examples:
  cubestack conformance emulated:{first} --allow-write
  cubestack conformance /dev/ttyUSB0 --device {second}
  cubestack conformance /dev/ttyUSB0 --device {second} \\
      --compare emulated:{second}
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable

from cubestack.host.cli.arguments import add_flag
from cubestack.host.cli.device_options import add_target_arguments, given_options, open_any_target
from cubestack.host.conformance.comparison import Difference, compare, table
from cubestack.host.conformance.contract import CheckResult, CheckRun, Verdict
from cubestack.host.conformance.suite import run_suite
from cubestack.host.targets import Target
from cubestack.host.terminal import busy, tell

MARKS = {Verdict.PASSED: "ok", Verdict.FAILED: "FAILED"}
NAME_COLUMNS = 52
DETAIL_COLUMNS = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_target_arguments(parser)
    add_flag(parser, "--allow-write", "also send telecommands and write registers")
    parser.add_argument(
        "--compare", metavar="TARGET", help="compare with another target and show all differences"
    )
    add_flag(parser, "--json", "print one JSON object per check")


def run(args: argparse.Namespace) -> int:
    show = _show_json if args.json else _show_text
    runs = []
    with open_any_target(args.target, args, keep=False) as target:
        args.device = args.device or target.interface.name.lower()
        second = _second(args)
        if args.compare is not None:
            try:
                open_any_target(args.compare, second).close()
            except BaseException:
                target.outputs.drop()  # a wrong call replaces no recording
                raise
        target.outputs.keep()
        runs.append(_checked(target, args, show))
    if args.compare is not None:
        with open_any_target(args.compare, second) as target:
            runs.append(_checked(target, args, lambda _check: None))
    differences = compare(*runs) if len(runs) == 2 else []
    _summarise(runs, differences, as_json=args.json)
    return int(any(one.failed for one in runs) or bool(differences))


def _second(args: argparse.Namespace) -> argparse.Namespace:
    """The options are the first target's, but for the device."""
    none = dict.fromkeys(("bench", "scene", "baud", "record", *given_options(args)))
    return argparse.Namespace(**vars(args) | none | {"backup": False, "engine": "auto"})


def _checked(
    target: Target, args: argparse.Namespace, on_check: Callable[[CheckResult], None]
) -> CheckRun:
    with busy(f"checking {target.name}", quiet=args.json):
        return run_suite(target, args.allow_write, on_check)


def _show_text(check: CheckResult) -> None:
    if check.verdict is Verdict.SKIPPED:
        return  # summed up at the end
    detail = check.detail
    short = sys.stdout.isatty() and check.verdict is Verdict.PASSED
    if short and len(detail) > DETAIL_COLUMNS:
        detail = detail[: DETAIL_COLUMNS - 3] + "..."
    tell(f"{MARKS[check.verdict]:<7}{check.name:<{NAME_COLUMNS}} {detail}".rstrip())


def _show_json(check: CheckResult) -> None:
    content = {"check": check.name, "outcome": check.verdict.value, "detail": check.detail}
    print(json.dumps(content), flush=True)


def _summarise(runs: list[CheckRun], differences: list[Difference], *, as_json: bool) -> None:
    for one in runs:
        counts = Counter(check.verdict for check in one.checks)
        numbers = {verdict.value: counts[verdict] for verdict in Verdict}
        if as_json:
            print(json.dumps({"target": one.target.name, **numbers}))
        else:
            reasons = Counter(c.detail for c in one.checks if c.verdict is Verdict.SKIPPED)
            for reason, number in reasons.items():
                print(f"{number} left out: {reason}")
            text = ", ".join(f"{number} {name}" for name, number in numbers.items())
            print(f"{one.target.name}: {text}")
    if len(runs) == 2 and as_json:
        listed = [vars(one) | {"kind": one.kind.value} for one in differences]
        print(json.dumps({"differences": listed}))
    elif len(runs) == 2:
        print("\n".join(table(differences, *(one.target.name for one in runs))))
