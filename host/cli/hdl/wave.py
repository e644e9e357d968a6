"""`cubestack hdl wave`."""

import argparse
from pathlib import Path

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_value
from cubestack.host.cli.hdl.waveform import find, show

NAME = "wave"

HELP = "show the waveform of a failed test"

DESCRIPTION = """Show the waveform of a failed gateware test, which `make test-hdl` and
`make test` keep: in gtkwave or surfer if installed and a screen is available,
else as text with the last changes of the pins.

examples:
  cubestack hdl wave whole_frame    part of a test's name; a wrong name lists all
  cubestack hdl wave whole_frame --text --internal --last 50"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", metavar="TEST", help="part of its name, or a VCD file")
    parser.add_argument(
        "--folder", type=Path, default=Path("out/hdl/waves"), help="default: %(default)s"
    )
    add_flag(parser, "--text", "print text even if a viewer is installed")
    add_value(parser, "last", whole(20, "number of changes in the text", 1, metavar="N"))
    add_flag(parser, "--internal", "include internal signals in the text")


def run(args: argparse.Namespace) -> int:
    for line in show(find(args.folder, args.test), args.last, args.internal, args.text):
        print(line)
    return 0
