"""CubeSense's FPGA for proofs: at full size, or so small that a counterexample is short."""

from collections.abc import Callable
from types import SimpleNamespace

from amaranth.hdl import Value
from amaranth.lib.wiring import Component
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.top import CubeSenseFpga

__all__ = ["SMALL", "column_row", "fpga"]

#: So small that a counterexample takes a few clocks.
SMALL = ReadOut(
    6, 3, 2, scan_step=2, first_row=1, first_column=1, window=3, window_left=1, window_above=1
)


def fpga(side: Side, mcu_addressing: bool = False) -> Callable[[bool], tuple[Component, ReadOut]]:
    """What makes the FPGA of a side, for :class:`cubestack.hdl.proofs.prover.Proof`."""

    def make(small: bool) -> tuple[Component, ReadOut]:
        size = SMALL if small else FULL_SIZE
        return CubeSenseFpga(side, size, mcu_addressing), size

    return make


def column_row(d: SimpleNamespace) -> tuple[Value, Value]:
    """The two halves of the SRAM's address."""
    bits = ceil_log2(d.size.columns)
    return d.SRAM_A[:bits], d.SRAM_A[bits:]
