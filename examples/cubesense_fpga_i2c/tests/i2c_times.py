"""How long the bus takes, in SCL periods, worked out from the bytes of each transfer.

The master's START takes half a period and its STOP three quarters, a repeated START a whole one,
each byte nine.
"""

from fractions import Fraction

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut

START, STOP, AGAIN, BYTE = Fraction(1, 2), Fraction(3, 4), Fraction(1), 9


def write(count: int) -> Fraction:
    """A register's number and ``count`` bytes."""
    return START + BYTE * (2 + count) + STOP


def read(written: int, count: int) -> Fraction:
    """A register's number, ``written`` bytes, and after a repeated START ``count`` bytes read."""
    return START + BYTE * (2 + written) + AGAIN + BYTE * (1 + count) + STOP


COMMAND = write(1)
STATUS = read(0, 1)
SUN = read(0, 3)
PIXEL = read(3, 1)
PICTURE = read(3, FULL_SIZE.pixels)


def window(size: ReadOut = FULL_SIZE) -> Fraction:
    """The Sun's place, then the window row by row."""
    return SUN + size.window * read(3, size.window)


def scan(size: ReadOut = FULL_SIZE) -> Fraction:
    """All scanned rows, then all scanned columns."""
    rows = len(size.scan_rows) * read(3, size.columns)
    return rows + len(size.scan_columns) * read(3, size.rows)
