"""CubeStar's FPGA board for the next version: FPGA and processor share one SRAM.

CubeStar thesis, option 2 of section 3.3, and section 7.2. The processor's external bus ends at the
FPGA, which connects it to the SRAM: either the processor has the whole memory, or the FPGA stores
an image there. Nothing is copied. It was not built then: pins and protocol are assumed.

How each asynchronous input is brought in:

- The camera's pins, ENABLE, RNW and BANK as in :mod:`cubestack.hdl.cubestar.top`.
- The bus is combinational; ALE clocks the address latch. RNW and ENABLE change only between two
  accesses.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, Signal

from cubestack.firmware_model.interface.cubestar.pins import SHARED
from cubestack.hdl.blocks.stride import Stride
from cubestack.hdl.cubestar.board import CubeStarBoard


class CubeStarShared(CubeStarBoard):
    """Frame buffer and bus switch.

    ENABLE = 0: standby, every output at its reset value except the top bit of SRAM_A, which keeps
    the bank. ENABLE = 1, RNW = 0: store the next whole frame, then raise ACK; the bus is
    disconnected and AD_LOW not driven. ENABLE = 1, RNW = 1: the bus is connected to the SRAM, at
    addresses bank : row : column.
    """

    _pins = SHARED
    _banks = True

    @property
    def strides(self) -> tuple[Stride, ...]:
        return (self._row_stored(),)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.enable = ClockDomain(reset_less=True, local=True)
        storing = Signal()
        bank = Signal()
        m.d.enable += bank.eq(self.BANK)
        m.d.comb += [storing.eq(self.ENABLE & ~self.RNW), ClockSignal("enable").eq(self.ENABLE)]
        writer = self._add_writer(m, storing)
        bus = self._add_bus(m, self.ENABLE & self.RNW, len(self.SRAM_A))
        m.d.comb += [
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
