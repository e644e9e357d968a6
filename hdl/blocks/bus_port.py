"""The processor's external bus, as an FPGA sees it: 24 address and 8 data bits on 16 lines.

CubeStar thesis, sections 3.3 (options 2 and 3) and C.4; the bus is the EFM32's EBI in its mode
D8A24ALE. First the lines carry address bits 23 to 8, which ALE has latched, then address bits 7
to 0 on the upper half and the data on the lower one. The FPGA holds the latch that is a part of its
own (SN74LVCH16373A) on the processor board.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.lib.wiring import Component, In, Out


class BusPort(Component):
    """Address latch and strobes.

    The latch takes the lines at the falling edge of ``ale``, which must not come before they are
    stable. The other ways are without a clock: the strobes of the processor are those of the SRAM.

    Ports:
        on: while low the latch is in reset and every output 0.
        high, low: the 16 lines' halves, as inputs.
        ale: address latch enable, high active.
        cs_n, re_n, we_n: chip select and strobes, low active. Reading wins over writing.
        address: of the access; its low 8 bits follow ``high``.
        selected: the chip select, high active.
        reading, writing: an access is going on.
        data: the byte to be written, else 0.
    """

    def __init__(self, address_width: int) -> None:
        """Make a port of an address of at most 24 bits; else ValueError."""
        if not 0 < address_width <= 24:
            raise ValueError(f"address_width must be in 1..24, not {address_width}")
        self._width = address_width
        lines = {"on": In(1), "high": In(8), "low": In(8), "ale": In(1)}
        strobes = dict.fromkeys(("cs_n", "re_n", "we_n"), In(1, init=1))
        access = dict.fromkeys(("selected", "reading", "writing"), Out(1))
        super().__init__(
            {**lines, **strobes, "address": Out(address_width), **access, "data": Out(8)}
        )

    def elaborate(self, platform: object) -> Module:
        """Build the latch and the gates."""
        m = Module()
        m.d.comb += [
            self.selected.eq(self.on & ~self.cs_n),
            self.reading.eq(self.selected & ~self.re_n),
            self.writing.eq(self.selected & self.re_n & ~self.we_n),
            self.data.eq(self.low & self.writing.replicate(8)),
        ]
        low_address = self.high & self.on.replicate(8)
        if self._width <= 8:
            m.d.comb += self.address.eq(low_address)
            return m
        m.domains.ale = ClockDomain(clk_edge="neg", async_reset=True, local=True)
        m.d.comb += [ClockSignal("ale").eq(self.ale), ResetSignal("ale").eq(~self.on)]
        latched = Signal(self._width - 8)
        m.d.ale += latched.eq(Cat(self.low, self.high))
        m.d.comb += self.address.eq(Cat(low_address, latched))
        return m
