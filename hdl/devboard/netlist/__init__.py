"""Placed and routed netlists as models: read from the placer's JSON, changed, written as C++."""

from cubestack.hdl.devboard.netlist.cells import FlipFlop, Lut, Netlist, NetlistError, Ram
from cubestack.hdl.devboard.netlist.cpp import board_header
from cubestack.hdl.devboard.netlist.mutants import MUTANTS, mutate
from cubestack.hdl.devboard.netlist.read import read_netlist

__all__ = [
    "MUTANTS",
    "FlipFlop",
    "Lut",
    "Netlist",
    "NetlistError",
    "Ram",
    "board_header",
    "mutate",
    "read_netlist",
]
