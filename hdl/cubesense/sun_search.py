"""First Sun pixel: found while the picture is being stored.

CubeSense thesis, section 6.6.1 and figure 6.15. A lone bright pixel may be a damaged one, so the
first of three bright pixels side by side counts. The search as flown (appendix D.4) also counts
across the end of a line; the other one does not, because pixels there are not side by side.
"""

from amaranth.hdl import Module, Mux, Signal
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD, ReadOut


class SunSearch(Component):
    """Looks at each pixel in the clock period in which it is written.

    ``x`` and ``y`` keep their values in reset, and are of no meaning before the first frame. They
    become all ones, "not found", with the second clock after reset and in each gap between frames,
    and the first Sun pixel's once the third bright pixel is written. What comes after it in the
    same frame is ignored.

    As flown nothing says "not found": the first pixel of every run is noted at once, whatever
    follows, and a picture without a bright pixel leaves the coordinates as they were. ``start`` is
    ignored; reset alone begins a new search.

    Ports:
        start: between frames; the search begins again with the next one.
        store: ``pixel`` is being written.
        pixel: its value.
        address: its address, row : column.
        x, y: column and row of the first Sun pixel.
    """

    def __init__(self, read_out: ReadOut, *, domain: str = "pix") -> None:
        """Make a search in pictures of ``read_out``'s size."""
        self._column_bits = read_out.column_bits
        self._as_flown = read_out.as_flown
        self._domain = domain
        written = {"store": In(1), "pixel": In(8), "address": In(read_out.address_bits)}
        sun = {"x": Out(read_out.column_bits), "y": Out(read_out.row_bits)}
        super().__init__({"start": In(1), **written, **sun})

    def elaborate(self, platform: object) -> Module:
        """Build the count of bright pixels and the retained coordinates."""
        m = Module()
        sync = m.d[self._domain]
        # Reset does not reach these two, and while it lasts nothing is searched.
        x = Signal.like(self.x, reset_less=True)
        y = Signal.like(self.y, reset_less=True)
        m.d.comb += [self.x.eq(x), self.y.eq(y)]

        if self._as_flown:
            column, row = self.address[: self._column_bits], self.address[self._column_bits :]
            count = Signal(range(SUN_RUN + 1))
            bright_now = self.pixel >= SUN_THRESHOLD
            with m.If(self.store & (count != SUN_RUN)):
                sync += count.eq(Mux(bright_now, count + 1, 0))
                with m.If(bright_now & ~count.any()):
                    sync += [x.eq(column), y.eq(row)]
            return m

        awake = Signal()  # out of reset, so the coordinates may change
        searching = Signal()
        run = Signal(range(SUN_RUN))
        bright = Signal()
        found = Signal()
        m.d.comb += [
            bright.eq(self.store & (self.pixel >= SUN_THRESHOLD)),
            found.eq(searching & bright & (run == SUN_RUN - 1)),
        ]
        sync += awake.eq(1)
        with m.If(self.start):
            sync += [searching.eq(1), run.eq(0)]
        with m.Elif(found):
            sync += searching.eq(0)
        with m.Elif(bright):
            sync += run.eq(run + 1)
        with m.Else():
            sync += run.eq(0)

        with m.If(awake & self.start):
            sync += [x.eq(-1), y.eq(-1)]
        with m.Elif(found):
            sync += [
                x.eq(self.address[: self._column_bits] - (SUN_RUN - 1)),
                y.eq(self.address[self._column_bits :]),
            ]
        return m
