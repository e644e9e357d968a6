"""CubeSense's FPGAs from the microcontroller's side: commands, read-out order, Sun coordinates.

CubeSense thesis, tables 6.3 and 6.4 (commands), section 6.4.4 (address), section 6.5.1 and figure
6.7 (nadir scan), section 6.6 and figures 6.15 and 6.16 (Sun search and window), section 9.2.2
(address control from the microcontroller), appendices D.3 and D.4 (gateware as printed).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from itertools import product
from typing import NamedTuple


class Action(Enum):
    """Action of one of the two FPGAs. "Other" is the other FPGA, its camera or its sensor."""

    STANDBY = "standby"
    STORE = "own camera's image to own memory"
    READ = "image in own memory to the microcontroller"
    EDGE = "edge data in own memory to the microcontroller"
    SEND_PICTURE = "own camera's image to the other FPGA"
    STORE_OTHER = "other camera's image to own memory"
    SEND_EDGE = "other sensor's edge data in own memory to the other FPGA"
    PASS_EDGE = "edge data from the other FPGA to the microcontroller"
    TAKE_ADDRESS = "address in own memory from the microcontroller"
    READ_FROM = "image in own memory to the microcontroller, from the taken address on"


class Actions(NamedTuple):
    """Actions of both FPGAs."""

    sun: Action
    nadir: Action


@dataclass(frozen=True)
class FpgaCommand:
    """One row of the command table: levels, None for either; the two enables are active low."""

    shift: int | None
    edge: int | None
    rnw: int | None
    sunen: int
    naden: int
    actions: Actions

    @property
    def levels(self) -> tuple[int | None, ...]:
        return (self.shift, self.edge, self.rnw, self.sunen, self.naden)

    def fits(self, shift: int, edge: int, rnw: int, sunen: int, naden: int) -> bool:
        given = (shift, edge, rnw, sunen, naden)
        return all(row in (None, level) for row, level in zip(self.levels, given, strict=True))


_IDLE = Action.STANDBY

#: Table 6.4. The last row is assumed: the table leaves it open, table 7.1 has both cameras imaging.
COMMANDS = (
    FpgaCommand(None, None, None, 1, 1, Actions(_IDLE, _IDLE)),
    FpgaCommand(0, 0, 0, 0, 1, Actions(Action.STORE, _IDLE)),
    FpgaCommand(0, 0, 0, 1, 0, Actions(_IDLE, Action.STORE)),
    FpgaCommand(0, 0, 1, 0, 1, Actions(Action.READ, _IDLE)),
    FpgaCommand(0, 0, 1, 1, 0, Actions(_IDLE, Action.READ)),
    FpgaCommand(0, 1, 1, 0, 1, Actions(Action.EDGE, _IDLE)),
    FpgaCommand(0, 1, 1, 1, 0, Actions(_IDLE, Action.EDGE)),
    FpgaCommand(1, 0, 0, 0, 0, Actions(Action.SEND_PICTURE, Action.STORE_OTHER)),
    FpgaCommand(1, 0, 1, 0, 0, Actions(Action.STORE_OTHER, Action.SEND_PICTURE)),
    FpgaCommand(1, 1, 0, 0, 0, Actions(Action.PASS_EDGE, Action.SEND_EDGE)),
    FpgaCommand(1, 1, 1, 0, 0, Actions(Action.SEND_EDGE, Action.PASS_EDGE)),
    FpgaCommand(0, 0, 0, 0, 0, Actions(Action.STORE, Action.STORE)),
)

#: Additional rows of a board with address control from the microcontroller, out of those that table
#: 6.4 leaves open; section 9.2.2 proposes it, the protocol is assumed. With an enable low, SHIFT
#: alone switches between the two rows, so no other row is crossed and the address is kept. The
#: microcontroller may drive the data bus while SHIFT and RNW are both low: no FPGA drives it then.
ADDRESSING_COMMANDS = (
    FpgaCommand(0, 1, 0, 0, 1, Actions(Action.TAKE_ADDRESS, _IDLE)),
    FpgaCommand(0, 1, 0, 1, 0, Actions(_IDLE, Action.TAKE_ADDRESS)),
    FpgaCommand(1, 1, 0, 0, 1, Actions(Action.READ_FROM, _IDLE)),
    FpgaCommand(1, 1, 0, 1, 0, Actions(_IDLE, Action.READ_FROM)),
)


def actions(
    shift: int, edge: int, rnw: int, sunen: int, naden: int, *, mcu_addressing: bool = False
) -> Actions:
    """Actions of both FPGAs; an unlisted row is standby. ``mcu_addressing`` adds its rows."""
    for command in COMMANDS + ADDRESSING_COMMANDS * mcu_addressing:
        if command.fits(shift, edge, rnw, sunen, naden):
            return command.actions
    return Actions(_IDLE, _IDLE)


def link_shows_enables(shift: int, edge: int) -> bool:
    """Whether each FPGA can see the other's enable at these levels.

    It cannot while an image crosses the link, which uses both control lines for its clock and its
    HREF. An FPGA that is enabled alone then acts as if the other were enabled too.
    """
    return not (shift and not edge)


def settled_rows(
    *, mcu_addressing: bool = False
) -> Iterator[tuple[tuple[int, int, int, int, int], Actions]]:
    """Levels as in :func:`actions`, and the actions, wherever each FPGA can know them."""
    for shift, edge, rnw, sunen, naden in product((0, 1), repeat=5):
        if sunen == naden or link_shows_enables(shift, edge):
            levels = shift, edge, rnw, sunen, naden
            yield levels, actions(*levels, mcu_addressing=mcu_addressing)


#: Data clocks, and bytes, of an address.
ADDRESS_BYTES = 3

#: Lowest value of a bright pixel; figure 6.15.
SUN_THRESHOLD = 200

#: Number of adjacent bright pixels of which the first is the first Sun pixel; figure 6.15.
SUN_RUN = 3

#: x and y that are read if an image has no Sun pixel; assumed.
SUN_NOT_FOUND = (0x3FF, 0x1FF)


@dataclass(frozen=True)
class ReadOut:
    """Image size and the pixels of the edge read-outs, counted from (0, 0).

    Nadir scan: ``scan_clocks`` data clocks. Two of them present no pixel of a scanned line: the
    first one, and the one between the last row and the first column. Sun window: four bytes (x low,
    x high, y low, y high), then the window row by row. Beyond the end the scan continues with its
    first column, and the window with its first pixel.
    """

    #: columns, rows: size of the image
    columns: int = 640
    rows: int = 480
    #: a frame starts with the first line after more clocks than this with HREF low
    frame_gap: int = 858
    scan_step: int = 64  #: distance of two scanned lines, a power of two
    #: first_row, first_column: first scanned row and column; below ``scan_step``
    first_row: int = 15
    first_column: int = 63
    window: int = 15  #: side of the Sun window
    #: window_left, window_above: distance of the window's origin to the left of and above the first
    #: Sun pixel, unless the image border is nearer
    window_left: int = 5
    window_above: int = 3
    #: as printed in appendices D.3 and D.4: the scan presents each pixel one clock earlier, and the
    #: window crosses the image border
    as_printed: bool = False
    #: each FPGA has only its own sensor's search. On commands for the other sensor's edge data, the
    #: owner of the memory sends the whole image, as table 6.4 words it, and the FPGA of the camera,
    #: not of the memory, searches for the first Sun pixel.
    one_search: bool = False

    def __post_init__(self) -> None:
        """Raise ValueError if a read-out does not fit the image."""
        if self.scan_step & (self.scan_step - 1):
            raise ValueError(f"scan_step must be a power of two, not {self.scan_step}")
        if not max(self.first_row, self.first_column) < self.scan_step:
            raise ValueError(
                f"first_row and first_column must be below scan_step {self.scan_step}, "
                f"not {self.first_row} and {self.first_column}"
            )
        if self.first_row >= self.rows or self.first_column >= self.columns:
            raise ValueError("the first scanned row and column must be inside of the image")
        if self.window > min(self.columns, self.rows):
            raise ValueError(
                f"a window of {self.window} does not fit into {self.columns} x {self.rows} pixels"
            )

    @property
    def pixels(self) -> int:
        return self.columns * self.rows

    @property
    def column_bits(self) -> int:
        """Bits of a column number, the low bits of an address."""
        return (self.columns - 1).bit_length()

    @property
    def row_bits(self) -> int:
        """Bits of a row number, the high bits of an address."""
        return (self.rows - 1).bit_length()

    @property
    def address_bits(self) -> int:
        return self.row_bits + self.column_bits

    @property
    def scan_rows(self) -> range:
        """Rows that the nadir scan presents, each from the first to the last column."""
        return range(self.first_row, self.rows, self.scan_step)

    @property
    def scan_columns(self) -> range:
        """Columns that it presents next, each from the first to the last row."""
        return range(self.first_column, self.columns, self.scan_step)

    @property
    def scan_clocks(self) -> int:
        """Data clocks of one nadir scan: 1 + 8 x 640 + 1 + 10 x 480 at full size."""
        horizontal = len(self.scan_rows) * self.columns
        return 1 + horizontal + 1 + len(self.scan_columns) * self.rows

    @property
    def scan_start(self) -> int:
        """Position on its line of the first pixel after a preset."""
        return int(self.as_printed)

    def scan(self) -> Iterator[tuple[int, int] | None]:
        """Pixel (x, y) that each clock of the nadir scan presents; None for a preset.

        As printed the second preset presents the first column's first pixel, each line ends with
        the next line's first pixel, the last row repeats its last pixel, and the last column ends
        with a pixel beyond the image.
        """
        rows = [(x, y) for y in self.scan_rows for x in range(self.columns)]
        columns = [(x, y) for x in self.scan_columns for y in range(self.rows)]
        if self.as_printed:
            beyond = (self.scan_columns[-1] + self.scan_step) % (1 << self.column_bits)
            yield from (None, *rows[1:], rows[-1], *columns, (beyond, 0))
        else:
            yield from (None, *rows, None, *columns)

    def window_origin(self, x: int, y: int) -> tuple[int, int]:
        """First pixel of the window around the first Sun pixel (x, y).

        It is inside the image; as printed it can be outside, with negative coordinates too.
        """
        if self.as_printed:
            return x - self.window_left, y - self.window_above
        return (
            min(max(x - self.window_left, 0), self.columns - self.window),
            min(max(y - self.window_above, 0), self.rows - self.window),
        )


#: The OV7620's image size and the published read-outs.
FULL_SIZE = ReadOut()

#: Read-outs by the value of switch ``gateware``.
READ_OUTS = {
    "both-searches": replace(FULL_SIZE, as_printed=True),
    "corrected": FULL_SIZE,
    "one-search": replace(FULL_SIZE, as_printed=True, one_search=True),
}


def address_bytes(x: int, y: int, size: ReadOut = FULL_SIZE) -> bytes:
    """Address row : column, highest byte first; raises ValueError outside the image."""
    if not (0 <= x < size.columns and 0 <= y < size.rows):
        raise ValueError(f"pixel ({x}, {y}) is not inside of {size.columns} x {size.rows} pixels")
    address = y << size.column_bits | x
    return address.to_bytes(ADDRESS_BYTES, "big")
