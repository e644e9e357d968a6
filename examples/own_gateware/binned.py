"""CubeStar's frame buffer with binning: each block of 2 x 2 pixels is stored as its mean.

The memory holds a quarter of the image, and the read-out repeats each mean, so that the firmware
reads an image of the usual size. The part has no block RAM, so a block's upper half waits in the
SRAM: it is read back while the lower left pixel arrives.
"""

import numpy as np
from amaranth.hdl import Cat, ClockDomain, ClockSignal, Const, Module, Mux, Signal
from amaranth.utils import ceil_log2
from numpy.typing import NDArray

from cubestack.hdl.cubestar.top import CubeStarTop


class Binned(CubeStarTop):
    """``columns`` and ``rows`` are even."""

    strides = ()  # a clock no longer stores a byte, so the shipped design's shortcut is wrong here

    def elaborate(self, platform: object) -> Module:
        m = super().elaborate(platform)
        writer, reader = m.submodules.writer, m.submodules.reader
        m.domains.fall = ClockDomain(clk_edge="neg", reset_less=True)
        bits = ceil_log2(self.columns)
        right, lower = writer.address[0], writer.address[bits]
        left = Signal(8)
        upper = Signal(8)
        mean = Signal(8)
        fetching = writer.store & ~right & lower
        writing = writer.store & right
        position = Mux(self.RNW, reader.address, writer.address)
        m.d.pix += left.eq(writer.data)
        with m.If(fetching):
            m.d.fall += upper.eq(self.SRAM_D_I)
        m.d.comb += [
            ClockSignal("fall").eq(self.PIXCLK),
            mean.eq((left + writer.data) >> 1),
            self.SRAM_A[:-1].eq(Cat(position[1:bits], Const(0), position[bits + 1 :], Const(0))),
            self.SRAM_D_O.eq(Mux(lower, (mean + upper) >> 1, mean)),
            self.SRAM_D_OE.eq(writing),
            # Only while PIXCLK is high: the SRAM leaves the bus before the FPGA drives it.
            self.SRAM_OE_N.eq(~((fetching & self.PIXCLK) | (self.ENABLE & self.RNW))),
            self.SRAM_WE_N.eq(~writing | self.PIXCLK),
        ]
        return m


def stored(frame: NDArray[np.uint8]) -> NDArray[np.int64]:
    """What a frame leaves in the memory; -1 where nothing is written."""
    wide = frame.astype(np.int64)
    rows = (wide[:, ::2] + wide[:, 1::2]) >> 1
    memory = np.full(frame.shape, -1)
    memory[: len(frame) // 2, : len(frame[0]) // 2] = (rows[::2] + rows[1::2]) >> 1
    return memory


def presented(memory: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """What the data clocks present of the memory."""
    quarter = memory[: len(memory) // 2, : len(memory[0]) // 2]
    return quarter.repeat(2, 0).repeat(2, 1)
