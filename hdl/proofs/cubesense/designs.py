"""CubeSense's designs for proofs, at full size or small enough for short counterexamples."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

from amaranth.hdl import Value

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, READ_OUTS, ReadOut
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.top import CubeSenseFpga

#: Creates a design and returns it with its size; small if the argument is True.
DesignMaker = Callable[[bool], tuple[PinnedComponent, ReadOut]]

#: Small enough that a counterexample takes a few clocks.
SMALL = ReadOut(
    6, 3, 2, scan_step=2, first_row=1, first_column=1, window=3, window_left=1, window_above=1
)


def proof_design(
    design: Callable[[ReadOut], PinnedComponent], gateware: str = "corrected"
) -> DesignMaker:
    """A function that creates the design for :class:`cubestack.hdl.proofs.prover.Proof`."""

    def make(small: bool) -> tuple[PinnedComponent, ReadOut]:
        known = READ_OUTS[gateware]
        options = {"as_printed": known.as_printed, "one_search": known.one_search}
        size = replace(SMALL if small else FULL_SIZE, **options)
        return design(size), size

    return make


def fpga(side: Side, mcu_addressing: bool = False, gateware: str = "corrected") -> DesignMaker:
    return proof_design(lambda size: CubeSenseFpga(side, size, mcu_addressing), gateware)


def column_row(d: SimpleNamespace) -> tuple[Value, Value]:
    bits = d.size.column_bits
    return d.SRAM_A[:bits], d.SRAM_A[bits:]
