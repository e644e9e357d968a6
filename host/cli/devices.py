"""Commands that take a device first, with options that depend on it."""

import argparse
from collections.abc import Callable, Mapping
from typing import Protocol

__all__ = ["DeviceModule", "add_devices"]


class DeviceModule(Protocol):
    """What a command does for one device: its docstring is the help's text."""

    __doc__: str | None
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_devices(
    parser: argparse.ArgumentParser, devices: Mapping[str, tuple[DeviceModule, str]]
) -> None:
    """Give ``parser`` a positional device; its module's ``run`` becomes ``args.run_device``.

    ``devices`` maps a name to its module and a phrase for the help.
    """
    commands = parser.add_subparsers(dest="device", required=True, metavar="device")
    for name, (module, summary) in devices.items():
        command = commands.add_parser(
            name,
            help=summary,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(command)
        command.set_defaults(run_device=module.run)
