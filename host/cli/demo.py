"""The whole stack in about a minute: boot, capture, measure and download, with
pictures.

An emulator process serves a device on pseudo-terminals; a client in this
process talks to it through pyserial and nothing else. First the star tracker:
a rendered sky, then a photograph, one of --photographs if that folder has any,
else a picture that this project rendered itself. Then the sun and nadir sensor:
the Sun, and the Earth from 750 km. Last the star tracker without FPGA: a sky.
"""

import argparse
from pathlib import Path

from cubestack.host.cli import demo_aramis, demo_cubesense, demo_cubestar
from cubestack.host.cli.arguments import whole

__all__ = ["add_arguments", "run"]

DEVICES = {
    "cubestar": demo_cubestar.show,
    "cubesense": demo_cubesense.show,
    "aramis": demo_aramis.show,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "device", nargs="?", choices=DEVICES, help="show this one only; default: all of them"
    )
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the pictures")
    parser.add_argument(
        "--photographs",
        type=Path,
        metavar="DIR",
        help="folder with JPEG photographs of the sky and their truth.json",
    )
    parser.add_argument(
        "--seed", type=whole(0), default=1, help="seed of the sensors' noise (default 1)"
    )


def run(args: argparse.Namespace) -> int:
    """Show the devices; returns 1 when one of them did not find what it looked for."""
    args.out.mkdir(parents=True, exist_ok=True)
    shown = [args.device] if args.device else list(DEVICES)
    found = [DEVICES[device](args) for device in shown]
    return 0 if all(found) else 1
