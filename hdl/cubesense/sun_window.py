"""Sun window: the first Sun pixel's coordinates, then the square of pixels around the Sun.

CubeSense thesis, section 6.6.2 and figure 6.16. At the image border the whole window moves inside
the image; as printed (appendix D.4) it wraps over the ends of the address.
"""

from amaranth.hdl import Cat, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut


class SunWindow(Component):
    """Steps through figure 6.16's states at each rising edge of its domain's clock.

    States A to D offer the coordinates in ``byte``, one after the other, and hold the address at 0.
    State E addresses the pixels of the window row by row and starts again after the last one. As
    flown the address has a register after its counters, which is not reset: the window's first byte
    is at the last address of the previous read-out, and the last pixel is followed by the row
    below.

    Ports:
        x, y: first Sun pixel; must be stable while the domain is out of reset.
        address: row : column of the pixel that the next clock presents.
        coordinate: state A, B, C or D: the next clock presents ``byte`` instead.
        byte: x low, x high, y low or y high.
    """

    def __init__(self, read_out: ReadOut, *, domain: str = "window") -> None:
        self._read_out = read_out
        self._domain = domain
        sun = {"x": In(read_out.column_bits), "y": In(read_out.row_bits)}
        offered = {"address": Out(read_out.address_bits), "coordinate": Out(1), "byte": Out(8)}
        super().__init__({**sun, **offered})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        state = Signal(range(4))  # A, B, C, D
        in_window = Signal()  # state E
        m.d[self._domain] += [state.eq(state + 1), in_window.eq(in_window | (state == 3))]
        pair = Mux(state[1], self.y, self.x)
        m.d.comb += [
            self.coordinate.eq(~in_window),
            self.byte.eq(Mux(state[0], pair[8:], pair[:8])),
        ]
        if self._read_out.as_printed:
            self._wrap_window(m, in_window)
        else:
            self._move_window_inside(m, in_window)
        return m

    def _wrap_window(self, m: Module, in_window: Signal) -> None:
        """The listing loads these counters while it waits; here, while coordinates are offered."""
        size, sync = self._read_out, m.d[self._domain]
        left = (self.x - size.window_left)[: len(self.x)]
        right = (left + size.window)[: len(left)]
        column = Signal.like(self.x, name="column")
        row = Signal.like(self.y, name="row")
        shown = Signal.like(self.address, reset_less=True)
        with m.If(~in_window):
            sync += [column.eq(left), row.eq(self.y - size.window_above)]
        with m.Else():
            next_column = Signal.like(column, name="next_column")
            next_row = Signal.like(row, name="next_row")
            m.d.comb += [next_column.eq(column + 1), next_row.eq(row)]
            with m.If((column + 1)[: len(column)] == right):
                m.d.comb += [next_column.eq(left), next_row.eq(row + 1)]
            sync += [column.eq(next_column), row.eq(next_row)]
            sync += shown.eq(Cat(next_column, next_row))
            m.d.comb += self.address.eq(shown)

    def _move_window_inside(self, m: Module, in_window: Signal) -> None:
        """Address = position in the window + the window's origin."""
        size = self._read_out
        right, last_column = self._position(m, "right", size.window_left, in_window)
        down, _ = self._position(m, "down", size.window_above, in_window & last_column)
        x = self._clamp(m, self.x, size.window_left, size.columns, in_window)
        y = self._clamp(m, self.y, size.window_above, size.rows, in_window)
        m.d.comb += self.address.eq(Cat((x + right)[: len(x)], (y + down)[: len(y)]))

    def _position(self, m: Module, name: str, before: int, step: Value) -> tuple[Signal, Value]:
        """Column or row in the window, from ``-before`` on, and whether it is the last one."""
        size = self._read_out.window
        position = Signal(range(-before, size - before), init=-before, name=name)
        last = position == size - before - 1
        with m.If(step):
            m.d[self._domain] += position.eq(Mux(last, -before, position + 1))
        return position, last

    def _clamp(self, m: Module, sun: Signal, before: int, length: int, in_window: Signal) -> Signal:
        """The pixel that the window is placed around: ``sun``, clamped away from the border.

        Outside of state E it is the smallest, so that the address is 0 then.
        """
        furthest = length - self._read_out.window + before
        clamped = Signal.like(sun, name=f"clamped_{sun.name}")
        with m.If(~in_window | (sun < before)):
            m.d.comb += clamped.eq(before)
        with m.Elif(sun > furthest):
            m.d.comb += clamped.eq(furthest)
        with m.Else():
            m.d.comb += clamped.eq(sun)
        return clamped
