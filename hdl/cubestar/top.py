"""CubeStar's FPGA board: an AGLN030 between image sensor, SRAM and microcontroller.

CubeStar thesis, section 5.2.2 and table C.2. Layout "option 1" of section 3.3: the FPGA owns the
SRAM, and the microcontroller reads it strictly in sequence.

How each asynchronous input is brought in:

- PIXDATA, HSYNC and VSYNC change with PIXCLK and are used in its domain only.
- ENABLE and RNW come from the microcontroller. For the PIXCLK domain, "not storing" is its
  reset: asserted at once, without a clock, released through two flip-flops. For the DCLK domain,
  "not reading" is its reset without a synchroniser, because the same microcontroller makes ENABLE,
  RNW and DCLK one after the other, and a synchroniser would swallow its first two clocks.
- BANK is latched by the rising edge of ENABLE and must be stable around it. Standby retains it: an
  address bit that fell with ENABLE could take a write pulse that ENABLE cuts off to the other bank.

No clock is ever switched: each counter has its own, and only the SRAM address is multiplexed.
"""

from typing import NamedTuple

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, Mux, ResetSignal, Signal
from amaranth.lib.cdc import ResetSynchronizer
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.frame_reader import FrameReader
from cubestack.hdl.blocks.frame_writer import FrameWriter
from cubestack.hdl.blocks.matrix_counter import MatrixCounter

__all__ = ["PINS", "CubeStarTop", "HeaderPin"]


class HeaderPin(NamedTuple):
    """One signal of the FPGA board's header."""

    pins: str
    port: str
    meaning: str


#: Table C.2. BANK is ours: the published board has the memory for two images but no pin to choose.
PINS = (
    HeaderPin("1-8", "PIXDATA", "pixel data from the image sensor"),
    HeaderPin("9", "ACK", "a whole image is stored"),
    HeaderPin("12", "ENABLE", "leave standby"),
    HeaderPin("14", "HSYNC", "low between lines"),
    HeaderPin("15", "BANK", "image bank, latched by ENABLE; tied low in the published wiring"),
    HeaderPin("16", "VSYNC", "low between frames"),
    HeaderPin("18", "PIXCLK", "pixel clock"),
    HeaderPin("19", "RNW", "read, not write"),
    HeaderPin("23-30", "DATA", "stored bytes to the microcontroller"),
    HeaderPin("32", "DCLK", "data clock from the microcontroller"),
)


class CubeStarTop(Component):
    """The frame buffer with the pins of table C.2 and its SRAM.

    The SRAM's data bus is an i / o / oe triple; its three strobes are low active.

    ENABLE = 0: standby, every output at its reset value but the top bit of SRAM_A, which keeps the
    bank. ENABLE = 1, RNW = 0: store the next whole frame, then raise ACK. ENABLE = 1, RNW = 1: each
    rising DCLK presents the next byte.
    """

    def __init__(self, columns: int = 1024, rows: int = 512) -> None:
        """Make the top for frames of ``columns`` x ``rows`` pixels and two banks of them."""
        self.columns = columns
        self.rows = rows
        super().__init__(
            {
                "PIXCLK": In(1),
                "PIXDATA": In(8),
                "HSYNC": In(1),
                "VSYNC": In(1),
                "ENABLE": In(1),
                "RNW": In(1),
                "BANK": In(1),
                "DCLK": In(1),
                "ACK": Out(1),
                "DATA": Out(8),
                "SRAM_A": Out(MatrixCounter.address_width(columns, rows) + 1),
                "SRAM_D_I": In(8),
                "SRAM_D_O": Out(8),
                "SRAM_D_OE": Out(1),
                "SRAM_CE_N": Out(1, init=1),
                "SRAM_OE_N": Out(1, init=1),
                "SRAM_WE_N": Out(1, init=1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Wire writer, reader and bank register to the pins."""
        m = Module()
        m.domains.pix = ClockDomain(async_reset=True)
        m.domains.dclk = ClockDomain(async_reset=True)
        m.domains.enable = ClockDomain(reset_less=True)

        storing = Signal()
        reading = Signal()
        m.d.comb += [
            storing.eq(self.ENABLE & ~self.RNW),
            reading.eq(self.ENABLE & self.RNW),
            ClockSignal("pix").eq(self.PIXCLK),
            ClockSignal("dclk").eq(self.DCLK),
            ResetSignal("dclk").eq(~reading),
            ClockSignal("enable").eq(self.ENABLE),
        ]
        m.submodules.pix_reset = ResetSynchronizer(~storing, domain="pix")
        m.submodules.writer = writer = FrameWriter(self.columns, self.rows, domain="pix")
        m.submodules.reader = reader = FrameReader(self.columns, self.rows, domain="dclk")

        bank = Signal()
        m.d.enable += bank.eq(self.BANK)

        m.d.comb += [
            writer.pixel.eq(self.PIXDATA),
            writer.hsync.eq(self.HSYNC),
            writer.vsync.eq(self.VSYNC),
            self.ACK.eq(writer.ack),
            reader.memory.eq(self.SRAM_D_I),
            self.DATA.eq(reader.data),
            self.SRAM_A.eq(Cat(Mux(self.RNW, reader.address, writer.address), bank)),
            self.SRAM_D_O.eq(writer.data),
            self.SRAM_D_OE.eq(writer.store),
            self.SRAM_CE_N.eq(~self.ENABLE),
            self.SRAM_OE_N.eq(~reading),
            # The pulse ends with the clock's rising edge itself, one flip-flop and one
            # multiplexer ahead of the address that the same edge moves on.
            self.SRAM_WE_N.eq(~writer.store | self.PIXCLK),
        ]
        return m
