"""`cubestack hdl area`."""

import argparse
from functools import partial

from cubestack.hdl.contract.design import Design
from cubestack.hdl.flow.area_report import area_json, area_table, areas
from cubestack.hdl.flow.top import Top, designs_with_area
from cubestack.host.cli.arguments import add_flag
from cubestack.host.cli.hdl.choice import chosen
from cubestack.host.cli.hdl.design import FILE, add_design, design_of
from cubestack.host.terminal import progress

NAME = "area"

HELP = "list the tiles that every design uses"

DESCRIPTION = """How many of the AGLN030's 768 tiles each design takes: a tile is one
3-input table or one flip-flop. An estimate: Yosys simplifies, a search covers
the result with tables, and nothing is placed. Blocks are counted alone; inside
of a top they share logic.

examples:
  cubestack hdl area
  cubestack hdl area "Sun search" "nadir scan"
  cubestack hdl area design.v --device DEVICE    a design of yours
  cubestack hdl area --ice40    a public yardstick beside it: iCE40 cells
  cubestack hdl area --ice40 --fmax --json    what each area.json in hdl/ tracks"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "names",
        metavar="NAME|FILE",
        nargs="*",
        help=f"designs, or their first letters; with --device: {FILE}",
    )
    add_design(parser)
    add_flag(parser, "--json", "as JSON")
    add_flag(parser, "--ice40", "count iCE40 cells too; needs the extra hdl")
    add_flag(parser, "--fmax", "place on an iCE40 HX8K; needs the extra place")


def run(args: argparse.Namespace) -> int:
    if args.device is None:
        table = chosen(designs_with_area(args.tops()), args.names, "design of one FPGA")
    else:
        designs = [design_of(args, text) for text in args.names or [""]]
        table = {one.title: _top(one) for one in designs}
    counting = areas(table, args.ice40, args.fmax)
    rows = list(progress(counting, len(table), "designs", quiet=args.json))
    print(area_json(rows) if args.json else "\n".join(area_table(rows)))
    return 0


def _top(design: Design) -> Top:
    return Top(partial(design.make, design.contract.full), design.title, ())
