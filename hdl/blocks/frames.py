"""Frames on their way from camera to SRAM, and from there to the microcontroller.

CubeStar thesis, section 5.2.2 and appendix C.
"""

from amaranth.hdl import Module, Signal
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.counters import MatrixCounter


class FrameGap(Component):
    """Derives VSYNC from pauses: low until the first frame starts, and low in each later gap.

    For a camera whose VSYN is not wired. CubeSense thesis, table 3.4: of the camera's control
    signals only PCLK and HREF are wired, and neither marks a frame. The thesis does not say how a
    frame's start is found: this is assumed.

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


class FrameWriter(Component):
    """Stores the first whole frame after its domain leaves reset, then raises ACK.

    One pixel is sampled at each rising edge of the pixel clock inside a row, and written during
    the low half of that clock period: the address, the data and ``store`` change after a rising
    edge only, so they are stable for the whole write pulse.

    All camera inputs are synchronous to the domain's clock, the camera's pixel clock. Reset is the
    idle state: nothing is stored and ``ack`` is low.

    - Storing starts only at the start of a row: a low HSYNC must come first.
    - A low VSYNC returns to the first row, so a frame that was joined half-way is dropped.
    - Pixels beyond the last column, and rows beyond the last one, are not stored. A row that is
      too short leaves its other pixels unchanged; a frame whose last row is too short is not
      acknowledged, and the next frame is stored in its place.
    - ``ack`` rises when the write pulse of the last pixel ends. It stays high, and nothing more is
      stored, until the next reset; VSYNC does not clear it.

    Ports:
        pixel: pixel data.
        hsync: low between rows.
        vsync: low between frames.
        address: SRAM address of the pixel in ``data``.
        data: pixel to write.
        store: high for the clock period in which ``data`` is written.
        ack: a whole frame is stored.
    """

    def __init__(self, columns: int, rows: int, *, domain: str = "pix") -> None:
        self._counter = MatrixCounter(columns, rows, domain=domain)
        self._domain = domain
        width = MatrixCounter.address_width(columns, rows)
        camera = {"pixel": In(8), "hsync": In(1), "vsync": In(1)}
        memory = {"address": Out(width), "data": Out(8), "store": Out(1)}
        super().__init__({**camera, **memory, "ack": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.counter = counter = self._counter
        sync = m.d[self._domain]

        between_lines_seen = Signal()  # since reset or VSYNC: a row's start can be recognised
        line_open = Signal()  # at least one pixel of this row was taken
        line_full = Signal()  # the row is complete; surplus pixels are ignored
        frame_full = Signal()  # the last row is over, complete or not

        storing_last_column = Signal()
        line_ends_short = Signal()
        accept = Signal()
        m.d.comb += [
            storing_last_column.eq(self.store & counter.last_column),
            line_ends_short.eq(~self.hsync & line_open & ~line_full & ~storing_last_column),
            accept.eq(
                self.hsync
                & self.vsync
                & between_lines_seen
                & ~line_full
                & ~storing_last_column
                & ~frame_full
                & ~self.ack
            ),
            counter.next_column.eq(self.store),
            counter.next_row.eq(line_ends_short),
            counter.clear.eq(~self.vsync),
            self.address.eq(counter.address),
        ]

        sync += [
            self.data.eq(self.pixel),
            self.store.eq(accept),
            between_lines_seen.eq(~self.hsync | (between_lines_seen & self.vsync)),
            line_open.eq(self.hsync & self.vsync & (line_open | accept)),
            line_full.eq(self.hsync & (line_full | storing_last_column)),
            frame_full.eq(self.vsync & (frame_full | (line_ends_short & counter.last_row))),
            self.ack.eq(self.ack | (storing_last_column & counter.last_row)),
        ]
        return m


class FrameReader(Component):
    """Presents the next byte at each rising edge of its domain's clock, the data clock.

    The microcontroller generates it, so it alone sets the rate, and reading works when the camera
    has no pixel clock.

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
