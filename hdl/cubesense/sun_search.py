"""Finds the first Sun pixel while the image is being stored.

CubeSense thesis, section 6.6.1 and figure 6.15. A single bright pixel may be damaged, so the first
of three adjacent bright pixels counts. The search as printed (appendix D.4) also counts across the
end of a line; the corrected one does not, because pixels there are not adjacent.
"""

from amaranth.hdl import Module, Mux, Signal
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD, ReadOut


class SunSearch(Component):
    """Examines each pixel in the clock period in which it is written.

    ``x`` and ``y`` keep their values in reset, and have no meaning before the first frame. They
    become all ones, "not found", with the second clock after reset and in each gap between frames,
    and those of the first Sun pixel once the third bright pixel is written. The rest of the same
    frame is ignored.

    As printed there is no "not found": the first pixel of every run is noted at once, whatever
    follows, and an image without a bright pixel leaves the coordinates unchanged. ``start`` is
    ignored; only reset begins a new search.

    Ports:
        start: between frames; the search begins again with the next one.
        store: ``pixel`` is being written.
        pixel: its value.
        address: its address, row : column.
        x, y: column and row of the first Sun pixel.
    """

    def __init__(self, read_out: ReadOut, *, domain: str = "pix") -> None:
        self._column_bits = read_out.column_bits
        self._as_printed = read_out.as_printed
        self._domain = domain
        written = {"store": In(1), "pixel": In(8), "address": In(read_out.address_bits)}
        sun = {"x": Out(read_out.column_bits), "y": Out(read_out.row_bits)}
        super().__init__({"start": In(1), **written, **sun})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        sync = m.d[self._domain]
        # These two are not reset, and nothing is searched during reset.
        x = Signal.like(self.x, reset_less=True)
        y = Signal.like(self.y, reset_less=True)
        m.d.comb += [self.x.eq(x), self.y.eq(y)]

        if self._as_printed:
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
