"""List a device's telecommands and telemetry, from the tables that firmware and host share.

examples:
  cubestack registers cubestar
  cubestack registers cubestar --format c > cubestar.h
  cubestack registers cubestar --format json
"""

import argparse

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.cli.session import DEVICES
from cubestack.host.registers import FORMATS, render

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=DEVICES, help="device whose interface is listed")
    parser.add_argument("--format", choices=FORMATS, default="table", help="default: table")


def run(args: argparse.Namespace) -> int:
    """Print the listing."""
    print(render(INTERFACE, args.format), end="")
    return 0
