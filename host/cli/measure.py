"""Measure end to end: scene, camera, FPGA, firmware, serial line, host; with
the truth beside each result.

Every frame is captured and processed by the emulated device; the host sees only
what comes back over the serial line. The truth is known to this command alone.

examples:
  cubestack measure cubestar --frames 20 --mag-limit 3.8
  cubestack measure aramis --frames 20
  cubestack measure cubesense --frames 20
  cubestack measure DEVICE --help
"""

import argparse

from cubestack.host.cli import measure_aramis, measure_cubesense, measure_cubestar
from cubestack.host.cli.devices import add_devices

__all__ = ["add_arguments", "run"]

DEVICES = {
    "cubestar": (measure_cubestar, "attitudes of the star tracker"),
    "aramis": (measure_aramis, "attitudes of the star tracker without FPGA"),
    "cubesense": (measure_cubesense, "directions of the Sun and of the Earth's centre"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the devices, each with options of its own."""
    add_devices(parser, DEVICES)


def run(args: argparse.Namespace) -> int:
    """Measure; returns 0 when every frame was measured, whether anything was found or not."""
    return int(args.run_device(args))
