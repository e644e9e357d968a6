"""Commands about particular devices, which the devices themselves declare."""

import argparse
from dataclasses import dataclass, field

from cubestack.host.cli.arguments import add_options
from cubestack.host.cli.measure import add_board, run_experiment
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.experiment import AnyExperiment
from cubestack.host.devices.registry import devices
from cubestack.host.experiments.measure import board_options
from cubestack.host.options import flag


@dataclass
class Reports:
    """One command: what the devices that have it say of themselves.

    Attributes:
        summary: one phrase for the help.
        found: the experiment of each device that has it, by the device's name.
    """

    summary: str
    found: dict[str, tuple[AnyDevice, AnyExperiment]] = field(default_factory=dict)

    @property
    def description(self) -> str:
        """Those of all devices."""
        return "\n".join(experiment.description for _, experiment in self.found.values())

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the device, and the options of all that can be it."""
        first = next(iter(self.found))
        parser.add_argument(
            "device", nargs="?", choices=tuple(self.found), default=first, help=f"default {first}"
        )
        parser.add_argument("--json", action="store_true", help="one JSON object a result")
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
                    raise ValueError(
                        f"{flag(name)} has no effect for {device.name}; it is {other.name}'s"
                    )
        return run_experiment(args, device, experiment)


def reports() -> dict[str, Reports]:
    """The commands that the registered devices declare, by name."""
    found: dict[str, Reports] = {}
    for device in devices():
        for report in device.reports:
            command = found.setdefault(report.name, Reports(report.summary))
            command.found[device.name] = (device, report.load())
    return found
