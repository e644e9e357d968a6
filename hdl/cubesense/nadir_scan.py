"""Nadir scan: the addresses of every 64th row, then of every 64th column.

CubeSense thesis, section 6.5.1 and figure 6.7: the k-th clock of a line presents its k-th pixel.
As printed (appendix D.3) the address has a register after its counters, which start at column 1,
and every pixel is one clock early; the program for it (appendix C.3) adds 1 to positions.
"""

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import Component, Out
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut


class NadirScan(Component):
    """Steps through figure 6.7's states at each rising edge of its domain's clock.

    In reset, and in the two states that preset (the default state and B), the address is 0; the
    clock that leaves such a state presents the byte there, which belongs to no line. States A
    (rows) and C (columns) address the pixel that the next clock presents. C repeats after its last
    pixel. As printed, state B does not change the address, and C runs on beyond the image.

    Ports:
        address: row : column.
    """

    def __init__(self, read_out: ReadOut, *, domain: str = "scan") -> None:
        self._read_out = read_out
        self._domain = domain
        super().__init__({"address": Out(read_out.address_bits)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        if self._read_out.as_printed:
            self._as_printed(m)
        else:
            self._exact(m)
        return m

    def _as_printed(self, m: Module) -> None:
        """A column counter, a row counter and the address register after them."""
        sync = m.d[self._domain]
        size = self._read_out
        column = Signal(size.column_bits, init=size.scan_start)
        row = Signal(size.row_bits, init=size.first_row)
        in_columns = Signal()  # state C
        between = Signal()  # state B; when neither is set: A
        with m.If(between):
            sync += [between.eq(0), in_columns.eq(1)]
        with m.Else():
            sync += self.address.eq(Cat(column, row))
        with m.If(in_columns):
            sync += row.eq(row + 1)
            with m.If(row == size.rows - 1):
                sync += [row.eq(0), column.eq(column + size.scan_step)]
        with m.Elif(~between):
            sync += column.eq(column + 1)
            with m.If(column == size.columns - 1):
                sync += [column.eq(0), row.eq(row + size.scan_step)]
                with m.If(row == size.scan_rows[-1]):
                    sync += [between.eq(1), column.eq(size.first_column), row.eq(0)]

    def _exact(self, m: Module) -> None:
        """One counter along the line and one of lines; they swap roles for the columns."""
        sync = m.d[self._domain]
        size = self._read_out
        column_bits, row_bits = size.column_bits, size.row_bits
        step_bits = ceil_log2(size.scan_step)

        on_a_line = Signal()  # state A or C; otherwise the default state or B
        vertical = Signal()  # state B or C
        along = Signal(max(column_bits, row_bits))  # position on the line
        line = Signal(range(max(len(size.scan_rows), len(size.scan_columns), 2)))

        line_ends = Signal()
        last_line = Signal()
        m.d.comb += [
            line_ends.eq(along == Mux(vertical, size.rows - 1, size.columns - 1)),
            last_line.eq(
                line == Mux(vertical, len(size.scan_columns) - 1, len(size.scan_rows) - 1)
            ),
        ]
        with m.If(~on_a_line):
            sync += on_a_line.eq(1)
        with m.Elif(~line_ends):
            sync += along.eq(along + 1)
        with m.Else():
            sync += along.eq(0)
            with m.If(~last_line):
                sync += line.eq(line + 1)
            with m.Else():
                sync += [line.eq(0), vertical.eq(1), on_a_line.eq(vertical)]

        # Where along and line are 0, the address is the first line's offset.
        scanned_row = Cat(Const(size.first_row, step_bits) & on_a_line.replicate(step_bits), line)
        scanned_column = Cat(
            Const(size.first_column, step_bits) & on_a_line.replicate(step_bits), line
        )
        m.d.comb += self.address.eq(
            Cat(
                Mux(vertical, scanned_column, along)[:column_bits],
                Mux(vertical, along, scanned_row)[:row_bits],
            )
        )
