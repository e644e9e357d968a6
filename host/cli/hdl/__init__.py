"""FPGA designs: area, Verilog for other tools, formal proofs, tests of a design of
yours, waveforms of failed tests.

examples:
  cubestack hdl area
  cubestack hdl area --ice40 --json
  cubestack hdl verilog TOP --out top.v
  cubestack hdl verilog TOP | yosys -f verilog -p 'synth_ice40' -
  cubestack hdl prove sun-scan
  cubestack hdl test design.v --device DEVICE
  cubestack hdl wave whole_frame
  cubestack hdl board icebreaker --top TOP --out out/board
"""

import argparse
from collections.abc import Callable, Mapping

from cubestack.hdl.flow.top import TopTable
from cubestack.hdl.proofs.prover import Proof
from cubestack.host.cli.arguments import Parser
from cubestack.host.cli.hdl import area, board, compare, prove, test, verilog, wave
from cubestack.host.devices.registry import merged_tables

#: One module per action, in the order of the help. Each has NAME, HELP, DESCRIPTION,
#: ``add_arguments`` and ``run``.
ACTIONS = (area, verilog, prove, test, wave, compare, board)


def _all_tops() -> TopTable:
    return merged_tables(lambda device: device.tops())


def _all_proofs() -> Mapping[str, Proof]:
    return merged_tables(lambda device: device.proofs())


def add_arguments(
    parser: argparse.ArgumentParser,
    tops: Callable[[], TopTable] = _all_tops,
    proofs: Callable[[], Mapping[str, Proof]] = _all_proofs,
) -> None:
    """Declare the subcommands and their options, for these tops and proofs."""
    parser.set_defaults(tops=tops, proofs=proofs)
    actions = parser.add_subparsers(
        dest="action", required=True, metavar="ACTION", parser_class=Parser
    )
    for action in ACTIONS:
        own = actions.add_parser(action.NAME, help=action.HELP, description=action.DESCRIPTION)
        action.add_arguments(own)
        own.set_defaults(act=action.run)


def run(args: argparse.Namespace) -> int:
    return int(args.act(args))
