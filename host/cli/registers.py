"""List a device's telecommands, telemetry and registers, from the tables that
firmware and host share, or its switches. `cubestack export` is for programs.

examples:
  cubestack registers {first}
  cubestack registers {first} --format json
  cubestack registers {first} --switches
  cubestack registers {first} --processor
"""

import argparse

from cubestack.host.cli.arguments import add_flag
from cubestack.host.devices.registry import device, emulated_names
from cubestack.host.export.interface import FORMATS, render, render_switches
from cubestack.host.export.processor import render_processor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("device", choices=emulated_names(), help="device whose interface is listed")
    parser.add_argument("--format", choices=tuple(FORMATS), default="table", help="default: table")
    add_flag(
        parser,
        "--processor",
        "registers and pin connections of the processor, for your own firmware",
    )
    add_flag(parser, "--switches", "switches between the published and better algorithms")


def run(args: argparse.Namespace) -> int:
    found = device(args.device)
    if args.processor:
        if found.processor is None:
            raise ValueError(f"the processor of {found.name} runs no firmware of your own")
        print(render_processor(found.processor(), args.format), end="")
    elif args.switches:
        print(render_switches(found.title, found.switches, args.format), end="")
    elif not found.interface.messages:
        raise ValueError(f"{found.name} has no messages; add --processor")
    else:
        print(render(found.interface, args.format), end="")
    return 0
