"""Calibrate a device's camera from images of a real or an emulated unit.

The result can be loaded into the device or `cubestack measure`; docs/how-to/calibration.md
describes how to take the images.

examples:
  cubestack calibrate {first} --emulated 20 --out camera.json
  cubestack calibrate DEVICE --help
"""

import argparse

from cubestack.host.cli.measure import add_devices, run_experiment


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the devices that can be calibrated, each with options of its own."""
    add_devices(parser, lambda device: device.study("calibrate"))


def run(args: argparse.Namespace) -> int:
    """Calibrate; returns 0 when there is a result."""
    return run_experiment(args, *args.chosen)
