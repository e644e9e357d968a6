"""The pair's commands and drivers, at its pins: for proofs of the shipped pair and of any other."""

from collections.abc import Collection
from types import SimpleNamespace

from amaranth.hdl import Assert, Cat, Const, Module, Value

from cubestack.firmware_model.interface.cubesense.fpga import Action
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.proofs.properties import one_sram_driver

#: Actions in which an FPGA drives DATA.
PRESENTS = {Action.READ, Action.EDGE, Action.PASS_EDGE, Action.READ_FROM}


def at_levels(d: SimpleNamespace, levels: Collection[int]) -> Value:
    """Whether the lines have the levels of a row of the command table."""
    lines = Cat(d.SHIFT, d.EDGE, d.RNW, d.SUNEN, d.NADEN)
    return lines == Cat(Const(level, 1) for level in levels)


def drivers(m: Module, d: SimpleNamespace) -> None:
    m.d.comb += Assert(d.CONTENTION == 0, "no wire has two drivers")
    for prefix in PREFIXES.values():
        one_sram_driver(m, d, f"{prefix}SRAM")
