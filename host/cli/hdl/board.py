"""`cubestack hdl board`."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from cubestack.firmware_model.interface.devboard.table import BAUD
from cubestack.firmware_model.values import whole
from cubestack.hdl.devboard.boards import BOARDS
from cubestack.hdl.devboard.netlist import MUTANTS
from cubestack.host.cli.arguments import Parser, add_flag, add_value
from cubestack.host.cli.device_options import add_board_arguments, chosen_options, given_options
from cubestack.host.cli.hdl import board_check
from cubestack.host.cli.hdl.choice import one
from cubestack.host.cli.hdl.design import fpga_wiring
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices, merged_tables
from cubestack.host.options import option_string
from cubestack.host.terminal import busy, say, tell

if TYPE_CHECKING:
    from cubestack.emulator.rtl.wiring import Wiring

NAME = "board"

HELP = "build the bitstream of a development board"

DESCRIPTION = """Build a bitstream with an FPGA design and a bridge to the serial port, so that a
development board takes the place of the compiled FPGA model. Needs the extra
board. Writes the bitstream, the placed netlist and the placer's report.

Exit status 1 if the design does not fit or is too slow.

examples:
  cubestack hdl board icebreaker --top TOP --out out/board
  cubestack hdl board ulx3s --device DEVICE --gateware design.v --out out/board
  cubestack hdl board icebreaker --top TOP --baud 1000000 --out out/board --json"""

SIMULATE = """Run the placed netlist of a build behind a pseudo-terminal, in place of a board
with its bitstream. Prints the port, and runs until it is interrupted. For a
quick simulation build with a high --baud, at most half of the bridge's clock.
Up to 64 boards side by side take little longer than one.

examples:
  cubestack hdl board icebreaker --top TOP --baud 6000000 --out out/board
  cubestack hdl board simulate out/board
  cubestack hdl board simulate out/board --mutant lut-bit"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(
        dest="board", required=True, metavar="BOARD", parser_class=Parser
    )
    for board in BOARDS.values():
        own = actions.add_parser(board.name, help=board.title, description=DESCRIPTION)
        _add_build_arguments(own)
        own.set_defaults(board_action=_build)
    simulate = actions.add_parser(
        "simulate", help="run a placed netlist in place of a board", description=SIMULATE
    )
    simulate.add_argument("folder", metavar="DIR", type=Path, help="--out of a build")
    names = ", ".join(MUTANTS)
    simulate.add_argument(
        "--mutant", choices=list(MUTANTS), metavar="FAULT", help=f"plant a fault: {names}"
    )
    add_value(simulate, "seed", whole(0, "chooses the fault's place", 0))
    add_value(simulate, "count", whole(1, "boards that run side by side, a port each", 1, 64))
    simulate.set_defaults(board_action=_simulate)
    check = actions.add_parser(
        board_check.NAME, help=board_check.HELP, description=board_check.DESCRIPTION
    )
    board_check.add_arguments(check)
    check.set_defaults(board_action=board_check.run)


def _add_build_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--top", metavar="TOP", help="a shipped design; a wrong name lists them")
    names = [device.name for device in devices() if device.has_fpga]
    parser.add_argument("--device", choices=names, help="the device with these options' design")
    add_value(parser, "baud", whole(BAUD, "rate of the serial port", 1))
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where to write")
    add_flag(parser, "--json", "print JSON")
    add_board_arguments(parser)


def run(args: argparse.Namespace) -> int:
    return int(args.board_action(args))


def _build(args: argparse.Namespace) -> int:
    from cubestack.emulator.rtl.devboard.lines import lines_of
    from cubestack.hdl.devboard.bitstream import BITSTREAM, build
    from cubestack.hdl.devboard.bridge import BridgeTiming

    board = BOARDS[args.board]
    timing = BridgeTiming(board.bridge_hz, args.baud)
    name, wiring = _design(args)
    with busy(f"building {name} for {board.title}", quiet=args.json):
        fit = build(wiring.component, lines_of(wiring), board, timing, name, args.out)
    if args.json:
        print(json.dumps({**fit.values(), "folder": str(args.out)}, indent=1))
    else:
        tell(fit.text())
    if fit.problem:
        say(fit.problem)
        return 1
    if not args.json:
        say(f"{args.out / BITSTREAM} is the bitstream")
    return 0


def _simulate(args: argparse.Namespace) -> int:
    from cubestack.emulator.rtl.board_model.netlist_board import netlist_boards
    from cubestack.emulator.rtl.board_model.port import BoardPorts

    with busy("compiling the netlist"):
        boards, fault = netlist_boards(args.folder, args.count, args.mutant or "", args.seed)
    if fault:
        say(fault)
    with BoardPorts(boards) as ports:
        print("\n".join(ports.paths), flush=True)
        ports.wait()
    return 1


def _design(args: argparse.Namespace) -> "tuple[str, Wiring]":
    """The design's name, and its wiring."""
    if args.device and args.top:
        raise ValueError("give --top, a shipped design, or --device, one with its options")
    if args.device:
        device = registered(args.device)
        wiring = fpga_wiring(device, chosen_options(args, device))
        return getattr(wiring.component, "title", device.name), wiring
    for name in given_options(args):
        raise ValueError(f"{option_string(name)} needs --device, the device that has it")
    wirings = merged_tables(lambda device: device.wirings())
    if not args.top:
        raise ValueError(f"say which design: --device, or --top, one of {', '.join(wirings)}")
    name, make = one(wirings, args.top, "top with cameras and memories")
    return name, make()
