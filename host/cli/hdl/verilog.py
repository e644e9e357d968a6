"""`cubestack hdl verilog`."""

import argparse

from cubestack.hdl.flow.top import tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.cli.arguments import add_output
from cubestack.host.cli.hdl.choice import one
from cubestack.host.output import write_output

NAME = "verilog"

HELP = "write a top as one Verilog file"

DESCRIPTION = """One Verilog file that needs no other: a wrapper with the real pins,
bidirectional ones too, around the design itself, with a list of the pins and a
stub of constraints as comments. Icarus Verilog, Yosys and Verilator take it
without a warning.

examples:
  cubestack hdl verilog TOP --out top.v     a wrong name of TOP lists all
  cubestack hdl verilog TOP | yosys -f verilog -p 'synth_ice40' -"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("top", metavar="TOP", help="a top; a wrong name lists them")
    add_output(parser, "--out", "default: standard output")


def run(args: argparse.Namespace) -> int:
    name, top = one(tops_in(args.tops()), args.top, "top")
    text = verilog_file(name, top)
    if args.out is None:
        print(text, end="")
    else:
        write_output(args.out, text)
    return 0
