"""Write a sensor of your own as a folder that installs: a photodiode behind a converter.

It measures, passes `cubestack conformance` and its own tests; change it step by step
into your sensor, as docs/how-to/adding-a-sensor.md shows.

example:
  cubestack new-sensor glow
  pip install --no-build-isolation -e ./glow-sensor
  cubestack measure glow --frames 5
"""

import argparse
from collections.abc import Iterator
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

from cubestack.host.cli.arguments import add_path
from cubestack.host.devices.device import check_name
from cubestack.host.devices.registry import device_names, devices
from cubestack.host.output import write_new_folder
from cubestack.host.terminal import tell

FILES = {
    "pyproject.toml": "pyproject.toml.txt",
    "{name}/__init__.py": "__init__.py.txt",
    "{name}/sensor.py": "sensor.py.txt",
    "tests/test_{name}.py": "test.py.txt",
}
"""Templates of a sensor called Glow, by the paths of what they become."""

ADDRESSES = range(0x29, 0x78)
"""I2C addresses to choose from; examples have the lower ones."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="of the device: small letters and digits")
    add_path(parser, "--out", "folder to write (default ./NAME-sensor)", "DIR")


def run(args: argparse.Namespace) -> None:
    """Write it; ValueError for a name that cannot be used, or a folder that exists."""
    name, folder = args.name, args.out or Path(f"{args.name}-sensor")
    check_name(name)
    if name in device_names():
        raise ValueError(f"{name} is a device already; choose another name")
    if find_spec(name) is not None:
        raise ValueError(f"{name} is a Python module already; choose another name")
    written = dict(rendered(name))
    write_new_folder(folder, written)
    for path in written:
        tell(str(folder / path))
    tell(f"install it: pip install --no-build-isolation -e {folder}")


def rendered(name: str) -> Iterator[tuple[str, str]]:
    taken = {one.interface.i2c_address for one in devices()}
    address = next(one for one in ADDRESSES if one not in taken)
    for path, template in FILES.items():
        text = files("cubestack.host.cli").joinpath("new_sensor_files", template)
        words = {"Glow": name.capitalize(), "glow": name, "0x29": f"{address:#04x}"}
        found = text.read_text(encoding="utf-8")
        for word, replacement in words.items():
            found = found.replace(word, replacement)
        yield path.format(name=name), found
