"""The microcontroller's place in the memory, which steps by itself.

CubeSense thesis, section 9.2.2. Steps along a row read the picture, a scanned row or a row of the
Sun's window; steps along a column read a scanned column. So the pointer replaces the machines that
:mod:`cubestack.hdl.cubesense.reader` has for these.
"""

from amaranth.hdl import Cat, Module, Signal
from amaranth.lib.wiring import Component, In, Out

from cubesense_fpga_i2c.register_table import PointerBits
from cubestack.firmware_model.interface.cubesense.fpga import ReadOut


class MemoryPointer(Component):
    """Row and column, in the domain ``domain``.

    A step goes to the next pixel of the row, after its last one to the next row, after the last
    row to the first one; or with ``down`` to the next pixel of the column, after its last one to
    the same column's first. From an address outside of the picture where it steps is not defined.

    Ports:
        load: a bit for each byte of the address, highest last, that ``byte`` is taken for.
        byte: part of row : column; the highest byte's bit 7 is ``down``.
        step: go on; only while no ``load`` is high.
        address: row : column.
        down: which way the steps go.
    """

    def __init__(self, read_out: ReadOut, *, domain: str = "bus") -> None:
        """Make a pointer into pictures of ``read_out``'s size, row : column of at most 23 bits."""
        self._read_out = read_out
        self._domain = domain
        super().__init__(
            {
                "load": In(3),
                "byte": In(8),
                "step": In(1),
                "address": Out(read_out.address_bits),
                "down": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Build the two counters and their loading."""
        m = Module()
        size = self._read_out
        column = Signal(range(size.columns))
        row = Signal(range(size.rows))
        down = Signal()
        sync = m.d[self._domain]
        m.d.comb += [self.address.eq(Cat(column, row)), self.down.eq(down)]

        last_column, last_row = column == size.columns - 1, row == size.rows - 1
        with m.If(self.step & ~down):
            with m.If(last_column):
                sync += column.eq(0)
            with m.Else():
                sync += column.eq(column + 1)
        with m.If(self.step & (down | last_column)):
            with m.If(last_row):
                sync += row.eq(0)
            with m.Else():
                sync += row.eq(row + 1)
        for number, low in enumerate(range(0, 8 * len(self.load), 8)):
            with m.If(self.load[number]):
                sync += Cat(column, row)[low : low + 8].eq(self.byte)
        with m.If(self.load[2]):
            sync += down.eq(self.byte[PointerBits.DOWN.bit_length() - 1])
        return m
