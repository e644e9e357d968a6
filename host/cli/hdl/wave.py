"""`cubestack hdl wave`."""

import argparse
from pathlib import Path

from cubestack.firmware_model.values import whole
from cubestack.hdl.proofs.counterexample import FOLDER
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.cli.hdl.waveform import find, show

#: Where failed tests and refuted proofs leave waveforms.
FOLDERS = (Path("out/hdl/waves"), FOLDER)

NAME = "wave"

HELP = "show the waveform of a failed test"

DESCRIPTION = """Show the waveform of a failed gateware test, which `make test-hdl` and
`make test` keep, or of a counterexample of `cubestack hdl prove`: in gtkwave or
surfer if installed and a screen is available, else as text with the last
changes of the pins.

examples:
  cubestack hdl wave whole_frame    part of a test's name; a wrong name lists all
  cubestack hdl wave whole_frame --text --internal --last 50"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", metavar="TEST", help="part of its name, or a VCD file")
    add_path(parser, "--folder", f"default: {' and '.join(map(str, FOLDERS))}", "DIR")
    add_flag(parser, "--text", "print text even if a viewer is installed")
    add_value(parser, "last", whole(20, "number of changes in the text", 1, metavar="N"))
    add_flag(parser, "--internal", "include internal signals in the text")


def run(args: argparse.Namespace) -> int:
    path = find([args.folder] if args.folder else FOLDERS, args.test)
    for line in show(path, args.last, args.internal, args.text):
        print(line)
    return 0
