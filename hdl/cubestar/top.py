"""CubeStar's FPGA board: an AGLN030 between image sensor, SRAM and microcontroller.

CubeStar thesis, section 5.2.2 and table C.2. Layout "option 1" of section 3.3: the FPGA owns the
SRAM, and the microcontroller reads it strictly in sequence.

How each asynchronous input is brought in:

- The camera's pins as in :mod:`cubestack.hdl.cubestar.board`.
- ENABLE and RNW come from the microcontroller. For the DCLK domain, "not reading" is the reset
  without a synchroniser, because the same microcontroller drives ENABLE, RNW and DCLK one after the
  other, and a synchroniser would swallow its first two clocks.
- BANK is latched by the rising edge of ENABLE and must be stable around it. Standby retains it: if
  the address bit fell with ENABLE, a write pulse that ENABLE cuts off could hit the other bank.

No clock is ever switched: each counter has its own, and only the SRAM address is multiplexed.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, Mux, ResetSignal, Signal

from cubestack.firmware_model.interface.cubestar import pins
from cubestack.firmware_model.interface.cubestar.pins import PUBLISHED
from cubestack.hdl.blocks.frames import FrameReader
from cubestack.hdl.blocks.pinned import Stride
from cubestack.hdl.cubestar.board import CubeStarBoard


class CubeStarTop(CubeStarBoard):
    """The frame buffer with the pins of table C.2 and its SRAM of two banks.

    The SRAM's data bus is an i / o / oe triple; its three strobes are active low.

    ENABLE = 0: standby, every output at its reset value except the top bit of SRAM_A, which keeps
    the bank. ENABLE = 1, RNW = 0: store the next whole frame, then raise ACK. ENABLE = 1, RNW = 1:
    each rising DCLK presents the next byte.
    """

    _pins = PUBLISHED
    _banks = True

    @property
    def strides(self) -> tuple[Stride, ...]:
        read = Stride(
            "row-read",
            clock=pins.DCLK,
            levels=((pins.ENABLE, 1), (pins.RNW, 1)),
            state=(),
            counter="reader.counter.column",
            last=self.columns - 1,
            data="reader.data",
            source="SRAM_D_I",
            memory="SRAM",
            access="read",
        )
        return self._row_stored(), read

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.dclk = ClockDomain(async_reset=True)
        m.domains.enable = ClockDomain(reset_less=True)
        storing = Signal()
        reading = Signal()
        m.d.comb += [
            storing.eq(self.ENABLE & ~self.RNW),
            reading.eq(self.ENABLE & self.RNW),
            ClockSignal("dclk").eq(self.DCLK),
            ResetSignal("dclk").eq(~reading),
            ClockSignal("enable").eq(self.ENABLE),
        ]
        writer = self._add_writer(m, storing)
        m.submodules.reader = reader = FrameReader(self.columns, self.rows, domain="dclk")
        bank = Signal()
        m.d.enable += bank.eq(self.BANK)
        m.d.comb += [
            reader.memory.eq(self.SRAM_D_I),
            self.DATA.eq(reader.data),
            self.SRAM_A.eq(Cat(Mux(self.RNW, reader.address, writer.address), bank)),
            self.SRAM_D_O.eq(writer.data),
            self.SRAM_D_OE.eq(writer.store),
            self.SRAM_CE_N.eq(~self.ENABLE),
            self.SRAM_OE_N.eq(~reading),
            # The pulse ends with the clock's rising edge itself, one flip-flop and one
            # multiplexer before the address that this edge advances.
            self.SRAM_WE_N.eq(~writer.store | self.PIXCLK),
        ]
        return m
