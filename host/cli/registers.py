"""List a device's telecommands, telemetry and registers, from the tables that
firmware and host share.

examples:
  cubestack registers {first}
  cubestack registers {first} --format c > {first}.h
  cubestack registers {first} --format json
"""

import argparse

from cubestack.host.devices.registry import device, device_names
from cubestack.host.export.interface import FORMATS, render


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("device", choices=device_names(), help="device whose interface is listed")
    parser.add_argument("--format", choices=FORMATS, default="table", help="default: table")


def run(args: argparse.Namespace) -> int:
    """Print the listing."""
    print(render(device(args.device).interface, args.format), end="")
    return 0
