"""Size of the frame in the simulation that imports this, from its environment."""

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


GEOMETRY = Geometry(int(os.environ["FRAME_COLUMNS"]), int(os.environ["FRAME_ROWS"]))
