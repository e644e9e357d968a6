"""SRAM to microcontroller: presents the stored frame byte by byte.

CubeStar thesis, section 5.2.2 and appendix C. The microcontroller generates the clock, so it alone
sets the rate, and reading works when the camera has no pixel clock.
"""

from amaranth.hdl import Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.matrix_counter import MatrixCounter


class FrameReader(Component):
    """Presents the next byte at each rising edge of its domain's clock, the data clock.

    In reset the address is that of the first pixel, so the SRAM already offers it at the first
    edge. The last pixel is followed by the first one again.

    Ports:
        address: SRAM address of the byte that the next edge will present.
        memory: the byte that the SRAM offers at that address.
        data: the byte presented to the microcontroller; 0 in reset.
    """

    def __init__(self, columns: int, rows: int, *, domain: str = "dclk") -> None:
        self._counter = MatrixCounter(columns, rows, domain=domain)
        self._domain = domain
        width = MatrixCounter.address_width(columns, rows)
        super().__init__({"address": Out(width), "memory": In(8), "data": Out(8)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.counter = counter = self._counter
        m.d.comb += [counter.next_column.eq(1), self.address.eq(counter.address)]
        m.d[self._domain] += self.data.eq(self.memory)
        return m
