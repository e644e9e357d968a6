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

from cubestack.firmware_model.interface.cubestar import pins
from cubestack.hdl.blocks.pinned import Stride, connect_ports
from cubestack.hdl.cubestar.board import CubeStarBoard


class CubeStarShared(CubeStarBoard):
    """Frame buffer and bus switch.

    ENABLE = 0: standby, every output at its reset value except the top bit of SRAM_A, which keeps
    the bank. ENABLE = 1, RNW = 0: store the next whole frame, then raise ACK; the bus is
    disconnected and AD_LOW not driven. ENABLE = 1, RNW = 1: the bus is connected to the SRAM, at
    addresses bank : row : column.
    """

    _pins = pins.SHARED
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


_OWN = [port.name for pin in pins.OWN_PINS for port in pin.ports]
_INPUTS = [port.name for pin in pins.SHARED for port in pin.ports if not port.output]
_COMMON = [name for name in _INPUTS if name not in _OWN]


class CubeStarTwoBoards(CubeStarBoard):
    """Two such boards on one bus: one stores an image while the processor reads the other.

    Section 7.2: a second such board doubles the update rate without any other change. Camera and
    bus go to both boards; each has its own control pins and chip select. The assignment of the
    wires is assumed. The ports are those of both boards.

    AD_LOW_O is 0 while no board drives the bus, that is while AD_LOW_OE is low. CONTENTION is high
    when both drive it, which happens only if both chip selects are low.
    """

    _pins = pins.TWO_BOARDS
    _banks = True

    def elaborate(self, platform: object) -> Module:
        m = Module()
        first, second = boards = [CubeStarShared(self.columns, self.rows) for _ in range(2)]
        m.submodules.board1, m.submodules.board2 = boards
        for prefix, board in zip(pins.BOARD_PREFIXES, boards, strict=True):
            own = [(name, prefix + name) for name in _OWN]
            connect_ports(m, board, self, [*((name, name) for name in _COMMON), *own])
        m.d.comb += [
            # An undriven output is 0.
            self.AD_LOW_O.eq(first.AD_LOW_O | second.AD_LOW_O),
            self.AD_LOW_OE.eq(first.AD_LOW_OE | second.AD_LOW_OE),
            self.CONTENTION.eq(first.AD_LOW_OE & second.AD_LOW_OE),
        ]
        return m
