"""CubeStar's frame buffer with binning: each block of 2 x 2 pixels is stored as its mean.

The memory holds a quarter of the image, and the read-out repeats each mean, so that the firmware
reads an image of the usual size. The part has no block RAM, so a block's upper half waits in the
SRAM: it is read back while the lower left pixel arrives.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Const, Module, Mux, Signal
from amaranth.utils import ceil_log2

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


def stored(frame: list[list[int]]) -> list[list[int]]:
    """What a frame leaves in the memory; -1 where nothing is written."""
    memory = [[-1] * len(row) for row in frame]
    for y in range(0, len(frame), 2):
        for x in range(0, len(frame[0]), 2):
            upper, lower = (sum(row[x : x + 2]) >> 1 for row in frame[y : y + 2])
            memory[y // 2][x // 2] = (upper + lower) >> 1
    return memory


def presented(memory: list[list[int]]) -> list[list[int]]:
    """What the data clocks present of the memory."""
    columns = range(len(memory[0]))
    return [[memory[y // 2][x // 2] for x in columns] for y in range(len(memory))]
