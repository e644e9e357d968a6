"""Measure the cost of the hot paths on this machine, on one core."""

import argparse
import json

from cubestack.host.devices.registry import devices
from cubestack.host.terminal import busy, tell

COMPARISON = "`make bench-engines` compares the engines that run the FPGA designs."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option, with the meaning of each figure."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    lines = [
        f"{name:<17} {device.title}: {meaning}"
        for device in devices()
        if (benchmark := device.study("bench"))
        for name, meaning in benchmark.figures.items()
    ]
    parser.epilog = "\n".join([*lines, "", f"{COMPARISON} (docs/engines.md)"])


def run(args: argparse.Namespace) -> int:
    figures: dict[str, float] = {}
    for device in devices():
        if benchmark := device.study("bench"):
            with busy(f"measuring {device.title}", quiet=args.json):
                figures |= benchmark.run(device)
    if args.json:
        print(json.dumps(figures))
        return 0
    for name, value in figures.items():
        tell(f"{name:>18}  {value:,}")
    return 0
