"""Tells frames apart where the camera's VSYN is not wired: by the long pause between them.

CubeSense thesis, table 3.4: of the camera's two control signals PCLK and HREF, none marks a frame.
How a frame's start is found from them is not published: it is assumed.
"""

from amaranth.hdl import Module, Signal
from amaranth.lib.wiring import Component, In, Out


class FrameGap(Component):
    """Makes a VSync: low until the first frame starts, and low in each later gap.

    A frame starts with the first row after more than ``clocks`` clocks with HREF low. Clocks
    count from the domain's reset on.

    Ports:
        href: high while pixels are sent; synchronous to the domain's clock.
        vsync: low from reset on until the first frame's first row, later from the clock that
            makes a pause a gap to the row that ends it. Follows ``href`` without a clock.
    """

    def __init__(self, clocks: int, *, domain: str = "pix") -> None:
        """Make one for gaps of more than ``clocks`` clocks, at least 1; else ValueError."""
        if clocks < 1:
            raise ValueError(f"clocks must be at least 1, not {clocks}")
        self._clocks = clocks
        self._domain = domain
        super().__init__({"href": In(1), "vsync": Out(1)})

    def elaborate(self, platform: object) -> Module:
        """Build the counter of clocks with HREF low."""
        m = Module()
        sync = m.d[self._domain]
        low_clocks = Signal(range(self._clocks + 1))
        long = Signal()
        gap = Signal()
        gap_seen = Signal()
        m.d.comb += [
            long.eq(low_clocks == self._clocks),
            gap.eq(~self.href & long),
            self.vsync.eq(gap_seen & ~gap),
        ]
        sync += gap_seen.eq(gap_seen | gap)
        with m.If(self.href):
            sync += low_clocks.eq(0)
        with m.Elif(~long):
            sync += low_clocks.eq(low_clocks + 1)
        return m
