"""CubeStar's top with a triple-voted counter in its writer: an upset of one copy is outvoted."""

from amaranth.hdl import Cat, Module, Signal

from cubestack.hdl.blocks.counters import MatrixCounter


class VotedCounter(MatrixCounter):
    """Three counters that continue from the majority."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        column, row = (Signal(range(size)) for size in (self._columns, self._rows))
        m.d.comb += [
            self.last_column.eq(column == self._columns - 1),
            self.last_row.eq(row == self._rows - 1),
            self.address.eq(Cat(column, row)),
        ]
        row_over = self.next_row | (self.next_column & self.last_column)
        for name, voted, clear, step in (
            ("column", column, self.clear | row_over, self.next_column),
            ("row", row, self.clear | (row_over & self.last_row), row_over),
        ):
            a, b, c = copies = [Signal(len(voted), name=f"{name}_{copy}") for copy in "abc"]
            m.d.comb += voted.eq((a & b) | (b & c) | (a & c))
            for one in copies:
                m.d[self._domain] += one.eq(voted)
                with m.If(clear):
                    m.d[self._domain] += one.eq(0)
                with m.Elif(step):
                    m.d[self._domain] += one.eq(voted + 1)
        return m
