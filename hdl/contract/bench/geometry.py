"""Size of the image, and records of what the pins did.

A testbench has one size, from ``FRAME_COLUMNS`` and ``FRAME_ROWS`` in the environment.
"""

import os
from typing import NamedTuple


class Geometry(NamedTuple):
    """Frame of ``columns`` x ``rows`` pixels; the address is bank : row : column."""

    columns: int
    rows: int

    @property
    def pixels(self) -> int:
        return self.columns * self.rows

    @property
    def position_bits(self) -> int:
        return (self.columns - 1).bit_length() + (self.rows - 1).bit_length()

    @property
    def bank_size(self) -> int:
        return 1 << self.position_bits

    def address(self, column: int, row: int, bank: int = 0) -> int:
        return bank * self.bank_size + (row << (self.columns - 1).bit_length()) + column

    def addresses(self, bank: int = 0) -> list[int]:
        return [self.address(x, y, bank) for y in range(self.rows) for x in range(self.columns)]


_SIZE = (int(os.environ.get(name, "4")) for name in ("FRAME_COLUMNS", "FRAME_ROWS"))
GEOMETRY = Geometry(*_SIZE)


class Tick(NamedTuple):
    """Camera pins at one rising edge of the pixel clock."""

    pixel: int
    hsync: int
    vsync: int


class Clock(NamedTuple):
    """One period of the pixel clock: its two edges in ps, and the pins at the rising one."""

    rise: int
    fall: int
    pins: Tick


class Pulse(NamedTuple):
    """One write pulse: WE_N low from ``start`` to ``end``, in ps."""

    start: int
    end: int
    address: int
    value: int
