"""List a device's telecommands, telemetry and registers, from the tables that
firmware and host share.

examples:
  cubestack registers cubestar
  cubestack registers cubestar --format c > cubestar.h
  cubestack registers cubestar --format json
"""

import argparse

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.export.interface import FORMATS, render

__all__ = ["add_arguments", "run"]

#: Interface of each device, by the name that the command line uses.
INTERFACES = {interface.name.lower(): interface for interface in (CUBESTAR, CUBESENSE, ARAMIS)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=INTERFACES, help="device whose interface is listed")
    parser.add_argument("--format", choices=FORMATS, default="table", help="default: table")


def run(args: argparse.Namespace) -> int:
    """Print the listing."""
    print(render(INTERFACES[args.device], args.format), end="")
    return 0
