"""CubeStar's FPGA board for the next version: one SRAM for FPGA and processor.

CubeStar thesis, option 2 of section 3.3, and section 7.2. The processor's external bus ends at the
FPGA, which connects it to the SRAM: the processor has the whole memory for itself, or the FPGA
stores a picture there. Nothing is copied. Not built then: pins and protocol are ours, and keep
those of the published board (table C.2) wherever they still serve.

How each asynchronous input is brought in:

- The camera's pins, ENABLE, RNW and BANK as in :mod:`cubestack.hdl.cubestar.top`.
- The bus passes through without a clock; ALE clocks the address latch. RNW and ENABLE change
  between two accesses only.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, Signal
from amaranth.lib.cdc import ResetSynchronizer
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.frame_writer import FrameWriter
from cubestack.hdl.blocks.matrix_counter import MatrixCounter

__all__ = ["PINS", "CubeStarShared"]

#: Meaning of each port but the SRAM's.
PINS = {
    "PIXCLK": "pixel clock",
    "PIXDATA": "pixel data from the image sensor",
    "HSYNC": "low between lines",
    "VSYNC": "low between frames",
    "ENABLE": "leave standby",
    "RNW": "the processor has the memory; else a picture is stored",
    "BANK": "image bank to store in, latched by ENABLE",
    "ACK": "a whole image is stored",
    "AD_HIGH": "bus: address bits 23..16, then 7..0",
    **dict.fromkeys(
        ("AD_LOW_I", "AD_LOW_O", "AD_LOW_OE"), "bus: address bits 15..8, then the data"
    ),
    "ALE": "bus: address latch enable, high active",
    "CS_N": "bus: chip select, low active",
    "RE_N": "bus: read strobe, low active",
    "WE_N": "bus: write strobe, low active",
}


class CubeStarShared(Component):
    """Frame buffer and bus switch.

    ENABLE = 0: standby, every output at its reset value but the top bit of SRAM_A, which keeps the
    bank. ENABLE = 1, RNW = 0: store the next whole frame, then raise ACK; the bus is cut off and
    AD_LOW not driven. ENABLE = 1, RNW = 1: the bus has the SRAM, at addresses bank : row : column.
    """

    def __init__(self, columns: int = 1024, rows: int = 512) -> None:
        """Make the top for frames of ``columns`` x ``rows`` pixels and two banks of them."""
        self.columns = columns
        self.rows = rows
        width = MatrixCounter.address_width(columns, rows) + 1
        super().__init__(
            {
                "PIXCLK": In(1),
                "PIXDATA": In(8),
                "HSYNC": In(1),
                "VSYNC": In(1),
                "ENABLE": In(1),
                "RNW": In(1),
                "BANK": In(1),
                "ACK": Out(1),
                "AD_HIGH": In(8),
                "AD_LOW_I": In(8),
                "AD_LOW_O": Out(8),
                "AD_LOW_OE": Out(1),
                "ALE": In(1),
                "CS_N": In(1, init=1),
                "RE_N": In(1, init=1),
                "WE_N": In(1, init=1),
                "SRAM_A": Out(width),
                "SRAM_D_I": In(8),
                "SRAM_D_O": Out(8),
                "SRAM_D_OE": Out(1),
                "SRAM_CE_N": Out(1, init=1),
                "SRAM_OE_N": Out(1, init=1),
                "SRAM_WE_N": Out(1, init=1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Wire writer, bus and bank register to the SRAM."""
        m = Module()
        m.domains.pix = ClockDomain(async_reset=True, local=True)
        m.domains.enable = ClockDomain(reset_less=True, local=True)
        storing = Signal()
        m.d.comb += [
            storing.eq(self.ENABLE & ~self.RNW),
            ClockSignal("pix").eq(self.PIXCLK),
            ClockSignal("enable").eq(self.ENABLE),
        ]
        m.submodules.pix_reset = ResetSynchronizer(~storing, domain="pix")
        m.submodules.writer = writer = FrameWriter(self.columns, self.rows, domain="pix")
        m.submodules.bus = bus = BusPort(len(self.SRAM_A))
        bank = Signal()
        m.d.enable += bank.eq(self.BANK)
        m.d.comb += [
            writer.pixel.eq(self.PIXDATA),
            writer.hsync.eq(self.HSYNC),
            writer.vsync.eq(self.VSYNC),
            self.ACK.eq(writer.ack),
            bus.on.eq(self.ENABLE & self.RNW),
            bus.high.eq(self.AD_HIGH),
            bus.low.eq(self.AD_LOW_I),
            bus.ale.eq(self.ALE),
            bus.cs_n.eq(self.CS_N),
            bus.re_n.eq(self.RE_N),
            bus.we_n.eq(self.WE_N),
            self.AD_LOW_O.eq(self.SRAM_D_I & bus.reading.replicate(8)),
            self.AD_LOW_OE.eq(bus.reading),
            # In reset the address and the data of each are 0.
            self.SRAM_A.eq(Cat(writer.address, bank & ~bus.on) | bus.address),
            self.SRAM_D_O.eq(writer.data | bus.data),
            self.SRAM_D_OE.eq(writer.store | bus.writing),
            self.SRAM_CE_N.eq(~(storing | bus.selected)),
            self.SRAM_OE_N.eq(~bus.reading),
            self.SRAM_WE_N.eq(~((writer.store & ~self.PIXCLK) | bus.writing)),
        ]
        return m
