"""A command about particular devices: its arguments, and how it runs."""

import argparse

from cubestack.host.cli.arguments import add_options
from cubestack.host.cli.measure import add_board, run_experiment
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.experiment import AnyExperiment
from cubestack.host.experiments.measure import board_options
from cubestack.host.options import option_string


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
        parser.add_argument("--json", action="store_true", help="print one JSON object per result")
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
