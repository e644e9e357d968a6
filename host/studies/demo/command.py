"""Run the whole stack in about a minute: boot, capture, measure and download, with
pictures.

An emulator process serves a device on pseudo-terminals; a client in this
process talks to it through pyserial and nothing else. A star tracker looks at
a rendered sky, and may look at a photograph, one of --photographs if that
folder has any; a sun and nadir sensor at the Sun, and at the Earth from 750 km.
"""

import argparse
from pathlib import Path

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_value
from cubestack.host.cli.device_options import add_option, given_options
from cubestack.host.devices.device import PROFILE_OPTIONS
from cubestack.host.devices.registry import devices


def add_arguments(parser: argparse.ArgumentParser) -> None:
    names = [one.name for one in devices() if "demo" in one.studies]
    parser.add_argument("device", nargs="?", choices=names, help="run this one only; default: all")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the pictures")
    parser.add_argument(
        "--photographs",
        type=Path,
        metavar="DIR",
        help="folder with JPEG photographs of the sky and their truth.json",
    )
    add_value(parser, "seed", whole(1, "seed of the sensors' noise (default 1)", 0))
    for option in PROFILE_OPTIONS:
        add_option(parser, option)


def run(args: argparse.Namespace) -> int:
    """Show the devices; returns 1 if one of them did not find its target."""
    args.out.mkdir(parents=True, exist_ok=True)
    board = [f"--{name}={value}" for name, value in given_options(args).items()]
    found = [
        one.study("demo")(one, args.out, args.seed, args.photographs, board)
        for one in devices()
        if "demo" in one.studies and args.device in (None, one.name)
    ]
    return 0 if all(found) else 1
