"""Derives VSYNC from the pauses between frames, for a camera whose VSYN is not wired.

CubeSense thesis, table 3.4: of the camera's control signals only PCLK and HREF are wired, and
neither marks a frame. The thesis does not say how a frame's start is found: this is assumed.
"""

from amaranth.hdl import Module, Signal
from amaranth.lib.wiring import Component, In, Out


class FrameGap(Component):
    """VSYNC: low until the first frame starts, and low in each later gap.

    A frame starts with the first row after more than ``clocks`` clocks with HREF low, counted from
    the domain's reset.

    Ports:
        href: high while pixels are sent; synchronous to the domain's clock.
        vsync: low from reset until the first frame's first row; later low from the clock at which
            a pause counts as a gap until the row that ends it. Combinational in ``href``.
    """

    def __init__(self, clocks: int, *, domain: str = "pix") -> None:
        """Raise ValueError unless ``clocks`` is at least 1."""
        if clocks < 1:
            raise ValueError(f"clocks must be at least 1, not {clocks}")
        self._clocks = clocks
        self._domain = domain
        super().__init__({"href": In(1), "vsync": Out(1)})

    def elaborate(self, platform: object) -> Module:
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
