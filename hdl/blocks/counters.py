"""Address counters: matrix addressing, and the Gray code, its alternative.

Matrix addressing, CubeSense thesis, section 6.5: the SRAM address is row : column, so each row
starts at its own column 0 whatever happened in the row before. CubeStar's frame of 1024 x 512 is a
power of two in both directions, so the address equals the linear one of the CubeStar thesis,
section 5.2.2.

Gray code, CubeSense thesis, section 6.4.4 and appendix D.1: one address line changes per step, but
the counter cannot jump to another row, and it takes more tiles.
"""

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2


class GrayCounter(Component):
    """Position in an image that is stored without gaps, in one clock domain.

    Both commands are sampled at the domain's rising edge, and ``clear`` wins. Position n has the
    address n ^ (n >> 1). The last position is followed by the first one; more than one line may
    change there, and on ``clear``.

    Ports:
        step: go to the next position.
        clear: go to the first position.
        last: high at the last position.
        address: Gray code of the position.
    """

    def __init__(self, positions: int, *, domain: str = "sync") -> None:
        """Raise ValueError unless ``positions`` is at least 4."""
        if positions < 4:
            raise ValueError(f"positions must be at least 4, not {positions}")
        self._positions = positions
        self._domain = domain
        super().__init__(
            {"step": In(1), "clear": In(1), "last": Out(1), "address": Out(ceil_log2(positions))}
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        width = len(self.address)
        even = Signal(init=1)  # the parity of the address; counts as the bit below the lowest
        address = Signal(width)
        last = self._positions - 1

        # A bit flips when the bit below it is 1 and all bits below that one are 0.
        flips = []
        below = [even, *address]
        zeros = 1  # all bits below below[n] are 0
        for n in range(width):
            one = below[n] if n < width - 1 else below[n] | below[n + 1]
            flips.append(one & zeros)
            zeros = zeros & ~below[n]
        m.d.comb += [self.address.eq(address), self.last.eq(address == last ^ (last >> 1))]
        with m.If(self.clear | (self.step & self.last)):
            m.d[self._domain] += [address.eq(0), even.eq(1)]
        with m.Elif(self.step):
            m.d[self._domain] += [address.eq(address ^ Cat(*flips)), even.eq(~even)]
        return m


class MatrixCounter(Component):
    """Position inside a frame of ``columns`` x ``rows`` pixels, in one clock domain.

    The three commands are sampled at the domain's rising edge; ``clear`` wins over ``next_row``,
    which wins over ``next_column``. The position never leaves the frame: the last column is
    followed by the next row, the last row by the first one. Only ``load`` can set a position
    outside of the frame; the steps from there are undefined.

    Ports:
        next_column: step to the next pixel.
        next_row: go to column 0 of the next row.
        clear: go to column 0 of row 0.
        last_column, last_row: high in the last column or row.
        address: row : column.
        load, position: go to this row : column; wins over the others. With ``loadable`` only.
    """

    def __init__(
        self, columns: int, rows: int, *, domain: str = "sync", loadable: bool = False
    ) -> None:
        """Raise ValueError unless ``columns`` and ``rows`` are at least 2."""
        for name, value in (("columns", columns), ("rows", rows)):
            if value < 2:
                raise ValueError(f"{name} must be at least 2, not {value}")
        self._columns = columns
        self._rows = rows
        self._domain = domain
        self._loadable = loadable
        width = self.address_width(columns, rows)
        commands = dict.fromkeys(("next_column", "next_row", "clear"), In(1))
        ends = dict.fromkeys(("last_column", "last_row"), Out(1))
        preset = {"load": In(1), "position": In(width)} if loadable else {}
        super().__init__({**commands, **ends, "address": Out(width), **preset})

    @staticmethod
    def address_width(columns: int, rows: int) -> int:
        """Number of address bits of a frame of ``columns`` x ``rows`` pixels."""
        return ceil_log2(columns) + ceil_log2(rows)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        column = Signal(range(self._columns))
        row = Signal(range(self._rows))
        m.d.comb += [
            self.last_column.eq(column == self._columns - 1),
            self.last_row.eq(row == self._rows - 1),
            self.address.eq(Cat(column, row)),
        ]
        row_over = self.next_row | (self.next_column & self.last_column)
        with m.If(self.clear | row_over):
            m.d[self._domain] += column.eq(0)
        with m.Elif(self.next_column):
            m.d[self._domain] += column.eq(column + 1)
        with m.If(self.clear | (row_over & self.last_row)):
            m.d[self._domain] += row.eq(0)
        with m.Elif(row_over):
            m.d[self._domain] += row.eq(row + 1)
        if self._loadable:
            with m.If(self.load):
                m.d[self._domain] += Cat(column, row).eq(self.position)
        return m
