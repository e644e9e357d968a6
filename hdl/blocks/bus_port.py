"""FPGA side of the processor's external bus: 24 address bits and 8 data bits on 16 lines.

CubeStar thesis, sections 3.3 (options 2 and 3) and C.4; the bus is the EFM32's EBI in its mode
D8A24ALE. First the lines carry address bits 23 to 8, which ALE latches, then address bits 7 to 0
on the upper half and the data on the lower half. The latch, a separate part (SN74LVCH16373A) on the
processor board, is inside the FPGA here.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.lib.wiring import Component, In, Out


class BusPort(Component):
    """Address latch and strobes.

    The latch samples the lines at the falling edge of ``ale``, when they must be stable. All other
    paths are combinational: the strobes of the processor are those of the SRAM.

    Ports:
        on: while low, the latch is in reset and every output is 0.
        high, low: upper and lower half of the 16 lines, as inputs.
        ale: address latch enable, active high.
        cs_n, re_n, we_n: chip select and strobes, active low. Reading wins over writing.
        address: of the access; its low 8 bits follow ``high``.
        selected: the chip select, active high.
        reading, writing: an access is in progress.
        data: the byte to write, else 0.
    """

    def __init__(self, address_width: int) -> None:
        """Raise ValueError unless ``address_width`` is 1 to 24 bits."""
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
