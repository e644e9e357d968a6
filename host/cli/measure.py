"""Measure end to end: scene, camera, electronics, firmware, serial line, host; with
the truth beside each result.

Every picture is captured and processed by the emulated device; the host sees only
what comes back over the serial line. The truth is known to this command alone.

examples:
  cubestack measure {first} --frames 20
  cubestack measure {second} --frames 20 --min-right 90    exit status 1 below 90 % right;
      without --min-right, when nothing at all was measured
  cubestack measure DEVICE --help
"""

import argparse
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any

from rich.table import Table

from cubestack.firmware_model.values import number
from cubestack.host.cli.arguments import Parser, add_flag, add_options, add_value, chosen
from cubestack.host.cli.device_options import (
    add_engine_arguments,
    add_insight_arguments,
    add_option,
    insight,
    options_of_others,
    show_notices,
)
from cubestack.host.cli.program import exit_status, read_console
from cubestack.host.devices.device import AnyDevice, BoardOption
from cubestack.host.devices.experiment import AnyExperiment, Result
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import TargetError
from cubestack.host.experiments.measure import board_as_said, board_options, running
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import option_string
from cubestack.host.output import Outputs
from cubestack.host.terminal import progress, say, show, tell

SHOWN = 40
"""Rows of a table."""


def add_arguments(parser: Parser) -> None:
    percent = number(
        None, "exit status 1 if fewer percent of the results are right", 0, 100, metavar="PCT"
    )
    add_devices(
        parser,
        lambda device: device.experiment,
        lambda command: add_value(command, "min_right", percent),
    )


def add_devices(
    parser: Parser,
    found: Callable[[AnyDevice], Callable[[], AnyExperiment] | None],
    further: Callable[[argparse.ArgumentParser], object] = lambda _command: None,
) -> None:
    """Declare the devices for which ``found`` returns what loads an experiment, and its options.

    ``further`` declares more options of each.
    """
    commands = parser.add_subparsers(dest="device", required=True, metavar="device")
    for name in parser.needed(device_names()):
        try:
            device = registered(name)
        except TargetError as error:  # must not keep the others from being measured
            commands.add_parser(name, help="does not load").failed = str(error)
            continue
        if (load := found(device)) is not None:
            declare = partial(_declare, device, load, further)
            commands.add_parser(name, help=device.summary, declare=declare)


def _declare(
    device: AnyDevice,
    load: Callable[[], AnyExperiment],
    further: Callable[[argparse.ArgumentParser], object],
    command: Parser,
) -> None:
    experiment = load()
    command.description = experiment.description
    add_flag(command, "--json", "print one JSON object per result and nothing else")
    add_options(command, experiment.options)
    add_board(command, (device, experiment))
    further(command)
    command.set_defaults(chosen=(device, experiment), others=partial(options_of_others, device))


def add_board(parser: argparse.ArgumentParser, *measured: tuple[AnyDevice, AnyExperiment]) -> None:
    """Declare how the devices' FPGAs are run, and what of their boards the user chooses."""
    if any(device.has_fpga and experiment.powers_up for device, experiment in measured):
        add_engine_arguments(parser)
    options: dict[str, BoardOption] = {}
    for device, experiment in measured:
        own = board_options(device, experiment)
        if device.processor is not None and "firmware" in own:
            add_insight_arguments(parser)
        options = {**own, **options}
    for option in options.values():
        add_option(parser, option)


def run(args: argparse.Namespace) -> int:
    """Measure; returns 0 when something was measured, or enough is right if `--min-right` asks."""
    return run_experiment(args, *args.chosen)


def run_experiment(args: argparse.Namespace, device: AnyDevice, experiment: AnyExperiment) -> int:
    """Run it as ``args`` say, and show its results; returns 1 when it was no success."""
    options = chosen(args, experiment.options)
    given = {name: getattr(args, name, None) for name in board_options(device, experiment)}
    board = {name: value for name, value in given.items() if value is not None}
    if experiment.powers_up:
        board = board_as_said(device, options, board)
    runs = running(device, experiment, board)
    if not args.json:
        show_notices(device, board, say)

    def bar(items: Iterable[Any], total: int, label: str) -> Iterator[Any]:
        return progress(items, total, label, quiet=args.json or not label)

    started = time.monotonic()
    results: list[Result] = []
    least: float | None = getattr(args, "min_right", None)
    with Outputs() as stack:
        look_at = insight(args, stack) if hasattr(args, "gdb") else lambda _emulated: None

        def connect(emulated: AnyEmulated) -> None:
            look_at(emulated)
            emulated.board.connect_program(_leave, read_console)

        opened = Opener(device, getattr(args, "engine", "auto"), board, bar, connect)
        shown = bar(experiment.run(opened, options), experiment.count(options), experiment.label)
        try:
            for result in shown:
                results.append(result)
                if least is not None and not hasattr(result, "right"):
                    what = f"results of {device.name} do not say what is right"
                    raise ValueError(f"{what}: no --min-right")
                if args.json:
                    print(json.dumps(result.as_dict() | runs), flush=True)
        except KeyboardInterrupt:
            if results and not args.json:
                _report(experiment, results, time.monotonic() - started, runs)
            say(f"stopped after {len(results)} of {experiment.count(options)}")
            raise
    if not args.json:
        _report(experiment, results, time.monotonic() - started, runs)
    if least is None:
        return 0 if experiment.succeeded(results) else 1
    return 0 if _are_right(results, least) else 1


def _leave(status: int) -> None:
    """End the command as the device's program ended."""
    say(f"the program exited by semihosting with status {status}")
    raise SystemExit(exit_status(status))


def _are_right(results: list[Result], least: float) -> bool:
    """Whether ``least`` percent are right; says so if not. Without a truth, none is."""
    verdicts = [getattr(result, "right", None) for result in results]
    share = 100 * verdicts.count(True) / max(1, len(verdicts))
    if share >= least:
        return True
    unknown = verdicts.count(None)
    beside = f", of {unknown} the truth is not known" if unknown else ""
    say(f"{share:.1f} % of {len(verdicts)} right{beside}; --min-right wants {least:g} %")
    return False


def _report(
    experiment: AnyExperiment, results: list[Result], wall_s: float, runs: Mapping[str, Any]
) -> None:
    """Show a table of the first results, and what all are together; ``runs`` as ``running``."""
    if experiment.columns:
        ran = "".join(f"; {what} {runs[what]}" for what in ("profile", "firmware") if what in runs)
        for name, value in runs.get("switches", {}).items():
            ran += f", {name}={value}"
        table = Table(title=experiment.title + ran)
        for column in experiment.columns[:-1]:
            table.add_column(column, justify="right")
        table.add_column(experiment.columns[-1], overflow="fold")
        for number, result in enumerate(results[:SHOWN]):
            table.add_row(*experiment.row(number, result))
        show(table)
        if len(results) > SHOWN:
            tell(f"... and {len(results) - SHOWN} more; --json lists them all")
    for line in experiment.summarise(results, wall_s):
        tell(line)


class ReportCommand:
    """The experiments of one command, by the name of their device."""

    def __init__(self, found: dict[str, tuple[AnyDevice, AnyExperiment]]) -> None:
        self.found = found
        self.__doc__ = "\n".join(experiment.description for _, experiment in found.values())

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the device, and the options of all that can be it."""
        first = next(iter(self.found))
        parser.add_argument(
            "device", nargs="?", choices=tuple(self.found), default=first, help=f"default {first}"
        )
        add_flag(parser, "--json", "print one JSON object per result")
        add_options(parser, *(experiment.options for _, experiment in self.found.values()))
        add_board(parser, *self.found.values())

    def run(self, args: argparse.Namespace) -> int:
        """Run it for the device; ValueError for an option that is another's."""
        device, experiment = self.found[args.device]
        own = experiment.options.declared()
        known = board_options(device, experiment)
        for other, theirs in self.found.values():
            for name, declared in board_options(other, theirs).items():
                if name not in known and getattr(args, name) is not None:
                    raise ValueError(f"{declared.flag} is an option of {other.name} alone")
            for name, option in theirs.options.declared().items():
                if name not in own and getattr(args, name) != option.default:
                    whose = f"has no effect for {device.name}; it is {other.name}'s"
                    raise ValueError(f"{option_string(name)} {whose}")
        return run_experiment(args, device, experiment)
