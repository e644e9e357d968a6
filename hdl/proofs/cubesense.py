"""What is proved of CubeSense's FPGAs."""

from collections.abc import Callable
from functools import partial
from itertools import product
from types import SimpleNamespace

from amaranth.hdl import (
    Array,
    Assert,
    Cat,
    Const,
    Module,
    Mux,
    Signal,
    Value,
)
from amaranth.lib.wiring import Component
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.cubesense_fpga import (
    ADDRESS_BYTES,
    FULL_SIZE,
    SUN_RUN,
    SUN_THRESHOLD,
    Action,
    ReadOut,
    actions,
    link_shows_enables,
)
from cubestack.hdl.cubesense_dataflow import Side
from cubestack.hdl.cubesense_pair import CubeSensePair
from cubestack.hdl.cubesense_top import CubeSenseFpga
from cubestack.hdl.proofs.claims import (
    acknowledges_all_rows,
    domain,
    idle_is_reset,
    starts_in,
    writer_wires,
)
from cubestack.hdl.proofs.prover import Fault, Proof

__all__ = ["PROOFS"]

#: So small that a counterexample takes a few clocks.
SMALL = ReadOut(
    6, 3, 2, scan_step=2, first_row=1, first_column=1, window=3, window_left=1, window_above=1
)


def _fpga(side: Side, mcu_addressing: bool = False) -> Callable[[bool], tuple[Component, ReadOut]]:
    def make(small: bool) -> tuple[Component, ReadOut]:
        size = SMALL if small else FULL_SIZE
        return CubeSenseFpga(side, size, mcu_addressing), size

    return make


def _column_row(d: SimpleNamespace) -> tuple[Value, Value]:
    bits = ceil_log2(d.size.columns)
    return d.SRAM_A[:bits], d.SRAM_A[bits:]


# The address never leaves the picture.

_POSITIONS = {
    "own_column": "pix_writer.counter.column",
    "own_row": "pix_writer.counter.row",
    "link_column": "link_writer.counter.column",
    "link_row": "link_writer.counter.row",
    "picture_column": "reader.picture.column",
    "picture_row": "reader.picture.row",
    "along": "reader.scan.along",
    "line": "reader.scan.line",
    "vertical": "reader.scan.vertical",
    "right": "reader.window.position",
    "down": "reader.window.position$4",
}


def _address_stays_inside(m: Module, d: SimpleNamespace) -> None:
    size = d.size
    starts_in(m, d.EN)
    for source in ("own", "link", "picture"):
        m.d.comb += [
            Assert(getattr(d, f"{source}_column") < size.columns),
            Assert(getattr(d, f"{source}_row") < size.rows),
        ]
    m.d.comb += [
        Assert(d.along < Mux(d.vertical, size.rows, size.columns)),
        Assert(d.line < Mux(d.vertical, len(size.scan_columns), len(size.scan_rows))),
    ]
    for position, before in ((d.right, size.window_left), (d.down, size.window_above)):
        m.d.comb += [
            Assert(position.as_signed() >= -before),
            Assert(position.as_signed() < size.window - before),
        ]
    column, row = _column_row(d)
    m.d.comb += [Assert(column < size.columns), Assert(row < size.rows)]


# Idle is reset.


def _idle(m: Module, d: SimpleNamespace) -> None:
    for name in ("ACK", "DATA_O", "DATA_OE", "LINK_D_O", "LINK_D_OE", "LINK_C_O", "LINK_C_OE"):
        m.d.comb += Assert(~d.EN | (getattr(d, name) == 0))
    for name in ("SRAM_A", "SRAM_D_O", "SRAM_D_OE"):
        m.d.comb += Assert(~d.EN | (getattr(d, name) == 0))
    for name in ("SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"):
        m.d.comb += Assert(~d.EN | getattr(d, name))
    idle_is_reset(m, d, d.EN, {"search.x", "search.y"})


# ACK exactly when all rows are stored.

_WRITERS = writer_wires("pix_writer", "pix") | writer_wires("link_writer", "link")


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, d.EN)
    size = d.size.columns, d.size.rows
    own = acknowledges_all_rows(m, d, "pix_writer", d.PCLK, *size)
    other = acknowledges_all_rows(m, d, "link_writer", d.LINK_C_I[0], *size)
    m.d.comb += Assert(own | other == d.ACK)


# No two drivers on in any settled state.

_DRIVES_DATA = {Action.READ, Action.EDGE, Action.PASS_EDGE, Action.READ_FROM}
_DRIVES_LINK = {Action.SEND_PICTURE, Action.SEND_EDGE}

_DRIVERS = {
    f"{side}_{port}": f"{side}.{port}"
    for side in ("sun", "nadir")
    for port in ("DATA_OE", "LINK_D_OE", "LINK_C_OE")
}


def _drivers(mcu_addressing: bool, m: Module, d: SimpleNamespace) -> None:
    m.d.comb += Assert(d.CONTENTION == 0)
    for prefix in ("SUN", "NAD"):
        drives, chip = getattr(d, f"{prefix}_SRAM_D_OE"), getattr(d, f"{prefix}_SRAM_OE_N")
        m.d.comb += Assert(~drives | chip)
    # Each row of the table, listed or not, where the wires can tell it from the others.
    lines = Cat(d.SHIFT, d.EDGE, d.RNW, d.SUNEN, d.NADEN)
    for levels in product((0, 1), repeat=5):
        shift, edge, _, sunen, naden = levels
        if sunen != naden and not link_shows_enables(shift, edge):
            continue
        here = lines == Cat(Const(level, 1) for level in levels)
        for side, action in actions(*levels, mcu_addressing=mcu_addressing)._asdict().items():
            data = getattr(d, f"{side}_DATA_OE") == (action in _DRIVES_DATA)
            link = getattr(d, f"{side}_LINK_D_OE") == (action in _DRIVES_LINK)
            m.d.comb += Assert(~here | (data & link))
    if mcu_addressing:
        microcontroller_may = (~d.SHIFT & ~d.RNW) | (d.SUNEN & d.NADEN)
        m.d.comb += Assert(~microcontroller_may | ~d.DATA_OE)


def _pair(mcu_addressing: bool, small: bool) -> tuple[Component, ReadOut]:
    size = SMALL if small else FULL_SIZE
    return CubeSensePair(size, mcu_addressing), size


# The scan visits exactly the declared addresses in order.

_SCAN = {
    "scan": "reader.scan",
    "on_a_line": "reader.scan.on_a_line",
    "vertical": "reader.scan.vertical",
    "along": "reader.scan.along",
    "line": "reader.scan.line",
}


def _scans(m: Module, d: SimpleNamespace) -> None:
    """The order of ``ReadOut.scan`` as three nested counts: row or column, line, pixel."""
    size = d.size
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.CLK, ~d.scan)
    preset = Signal(init=1)
    columns = Signal()  # of the lines, else rows
    line = Signal(range(max(len(size.scan_rows), len(size.scan_columns))))
    pixel = Signal(range(max(size.columns, size.rows)))
    lines = Mux(columns, len(size.scan_columns), len(size.scan_rows))
    length = Mux(columns, size.rows, size.columns)
    with m.If(preset):
        sync += preset.eq(0)
    with m.Elif(pixel != length - 1):
        sync += pixel.eq(pixel + 1)
    with m.Elif(line != lines - 1):
        sync += [pixel.eq(0), line.eq(line + 1)]
    with m.Else():
        # The preset between rows and columns comes once: columns follow columns.
        sync += [pixel.eq(0), line.eq(0), columns.eq(1), preset.eq(~columns)]
    x = Mux(columns, Array(size.scan_columns)[line], pixel)
    y = Mux(columns, pixel, Array(size.scan_rows)[line])
    column, row = _column_row(d)
    at_pixel = (column == x) & (row == y)
    m.d.comb += [
        Assert(~d.scan | Mux(preset, d.SRAM_A == 0, at_pixel)),
        # What makes this inductive.
        Assert((pixel < length) & (line < lines)),
        Assert((d.on_a_line == ~preset) & (d.vertical == columns)),
        Assert((d.along == pixel) & (d.line == line)),
        Assert(~preset | ((pixel == 0) & (line == 0))),
    ]


# The Sun window is inside of the picture, around the first Sun pixel.

_WINDOW = {
    "window": "reader.window",
    "x": "reader.sun_x",
    "y": "reader.sun_y",
    "in_window": "reader.window.in_window",
    "state": "reader.window.state",
    "right": "reader.window.position",
    "down": "reader.window.position$4",
}


def _windows(m: Module, d: SimpleNamespace) -> None:
    """``ReadOut.window_origin`` for any coordinates at all, those of no Sun too."""
    size = d.size
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.CLK, ~d.window)
    clocks = Signal(range(5))  # of the four coordinates
    i, j = Signal(range(size.window)), Signal(range(size.window))
    inside = clocks == 4
    with m.If(~inside):
        sync += clocks.eq(clocks + 1)
    with m.Elif(i != size.window - 1):
        sync += i.eq(i + 1)
    with m.Else():
        sync += [i.eq(0), j.eq(Mux(j == size.window - 1, 0, j + 1))]

    def origin(sun: Value, before: int, length: int) -> Value:
        furthest = length - size.window
        wanted = Mux(sun < before, 0, (sun - before)[: len(sun)])
        return Mux(wanted > furthest, furthest, wanted)

    left = origin(d.x, size.window_left, size.columns)
    top = origin(d.y, size.window_above, size.rows)
    column, row = _column_row(d)
    m.d.comb += [
        Assert((left + size.window <= size.columns) & (top + size.window <= size.rows)),
        Assert(~d.window | inside | (d.SRAM_A == 0)),
        Assert(~d.window | ~inside | ((column == left + i) & (row == top + j))),
        # What makes these inductive.
        Assert(clocks <= 4),
        Assert((i < size.window) & (j < size.window)),
        Assert((d.in_window == inside) & (inside | (d.state == clocks))),
        Assert(inside | ((i == 0) & (j == 0))),
        Assert(d.right.as_signed() == i - size.window_left),
        Assert(d.down.as_signed() == j - size.window_above),
    ]


# The first Sun pixel is the first of three bright ones side by side.

_SEARCH = {
    "x": "search.x",
    "y": "search.y",
    "awake": "search.awake",
    "searching": "search.searching",
    "run": "search.run",
    "pixel": "search.pixel",
}


def _searching(side: Side) -> dict[str, str]:
    """The sun camera's writer is the own one, or the link's."""
    writer, domain_name = ("pix_writer", "pix") if side == "sun" else ("link_writer", "link")
    wires = writer_wires("writer", domain_name, below=writer)
    return wires | _SEARCH | {"line_seen": f"{writer}.between_lines_seen"}


def _first_sun_pixel(side: Side, m: Module, d: SimpleNamespace) -> None:
    """By addresses: bright pixels are side by side when their columns follow in one row."""
    size = d.size
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.PCLK if side == "sun" else d.LINK_C_I[0], d.writer_rst)
    column, row, store = d.writer_column, d.writer_row, d.writer_store
    awake = Signal()
    began, found = Signal(), Signal()  # a search since reset; its Sun
    sun_x, sun_y = Signal.like(column), Signal.like(row)
    count = Signal(range(SUN_RUN + 1))  # bright pixels side by side that end with the last one
    last_x, last_y = Signal.like(column), Signal.like(row)

    start = ~d.writer_vsync & ~d.writer_ack
    bright = d.pixel >= SUN_THRESHOLD
    follows = (count != 0) & (column == last_x + 1) & (row == last_y)
    length = Mux(bright, Mux(follows, Mux(count == SUN_RUN, SUN_RUN, count + 1), 1), 0)
    sync += awake.eq(1)
    with m.If(start):
        sync += [count.eq(0), found.eq(0), began.eq(1)]
    with m.Elif(store):
        sync += [count.eq(length), last_x.eq(column), last_y.eq(row)]
        with m.If((length == SUN_RUN) & began & ~found):
            sync += [found.eq(1), sun_x.eq(column - (SUN_RUN - 1)), sun_y.eq(row)]
    shown = (d.x == sun_x) & (d.y == sun_y)
    none = d.x.all() & d.y.all()
    said_none = Signal()  # the first clock of reset's end leaves the coordinates as they were
    with m.If(start & awake):
        sync += said_none.eq(1)
    m.d.comb += [
        Assert(~found | shown),
        Assert(~found | ((sun_x + SUN_RUN <= size.columns) & (sun_y < size.rows))),
        Assert(~said_none | found | none),
        # What makes these inductive.
        Assert((column < size.columns) & (row < size.rows)),
        Assert(store | (column == 0)),
        Assert(~store | (d.writer_line_open & ~d.writer_line_full & d.line_seen)),
        Assert(~store | (~d.writer_frame_full & ~d.writer_ack)),
        Assert((d.awake == awake) & (awake | ~began) & (began | (~found & ~said_none))),
        Assert(d.searching == (began & ~found)),
        Assert(~d.searching | (d.run < SUN_RUN)),
        Assert(~d.searching | ~store | (column == 0) | (d.run == count)),
        Assert(~d.searching | ~store | (column != 0) | (d.run == 0)),
        Assert(~store | (column == 0) | (count == 0) | ((last_x + 1 == column) & (last_y == row))),
        Assert(~store | (column == 0) | (count <= column)),
    ]


# The microcontroller's address is the one that is read.

_TAKEN = {
    "addressing": "dataflow.addressing",
    "take": "dataflow.take_address",
    "read_from": "dataflow.read_from",
}


def _takes_addresses(m: Module, d: SimpleNamespace) -> None:
    """Three clocks make the address, whatever it was before; SHIFT alone never changes it."""
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.CLK, ~d.addressing)
    taken = Signal(8 * ADDRESS_BYTES)
    count = Signal(range(ADDRESS_BYTES + 1))  # bytes since the last read or reset, at most all
    with m.If(d.take):
        sync += taken.eq(Cat(d.DATA_I, taken))
        sync += count.eq(Mux(count == ADDRESS_BYTES, count, count + 1))
    with m.Else():
        sync += count.eq(0)
    bits = len(d.SRAM_A)
    same = Const(1)
    for known in range(1, ADDRESS_BYTES + 1):
        width = min(8 * known, bits)
        same &= (count != known) | (d.SRAM_A[:width] == taken[:width])
    m.d.comb += [
        Assert(~d.addressing | same),
        Assert(d.addressing == (d.take | d.read_from)),
        Assert(~d.take | (d.SRAM_CE_N & ~d.DATA_OE)),
        Assert(count <= ADDRESS_BYTES),
    ]


def _proofs(side: Side) -> dict[str, Proof]:
    """What is proved of one of the two FPGAs."""
    fpga = _fpga(side)
    return {
        f"{side}-address": Proof(
            "The SRAM address never leaves the picture",
            fpga,
            _POSITIONS,
            _address_stays_inside,
            Fault("reader.window.clamped_x", 7),
        ),
        f"{side}-ack": Proof(
            "ACK is high exactly from when all rows of a frame are stored",
            fpga,
            _WRITERS,
            _acknowledges,
            Fault("pix_writer.counter.last_row", 1),
        ),
        **{
            f"{side}-idle{'-addressing' * mcu_addressing}": Proof(
                "With EN high every register but the Sun's coordinates is reset, and they rest",
                _fpga(side, mcu_addressing),
                {},
                _idle,
                Fault("pix_writer.pix_rst" if side == "sun" else "link_writer.link_rst", 0),
            )
            for mcu_addressing in (False, True)
        },
        f"{side}-scan": Proof(
            "The nadir scan visits exactly the declared addresses in order",
            fpga,
            _SCAN,
            _scans,
            Fault("reader.scan.line_ends", 0),
        ),
        f"{side}-window": Proof(
            "The Sun window lies inside of the picture, around the first Sun pixel",
            fpga,
            _WINDOW,
            _windows,
            Fault("reader.window.clamped_y", 3),
        ),
        f"{side}-first-pixel": Proof(
            "The first Sun pixel is the first of three bright ones side by side",
            fpga,
            _searching(side),
            partial(_first_sun_pixel, side),
            Fault("search.bright", 1),
        ),
        f"{side}-taken-address": Proof(
            "What is read first is at the address that the microcontroller gave",
            _fpga(side, mcu_addressing=True),
            _TAKEN,
            _takes_addresses,
            Fault("dataflow.take_address", 1),
        ),
    }


#: By name.
PROOFS = {
    **{
        f"pair-drivers{'-addressing' * mcu_addressing}": Proof(
            "No wire of the two FPGAs has two drivers in any settled state",
            partial(_pair, mcu_addressing),
            _DRIVERS,
            partial(_drivers, mcu_addressing),
            Fault("nadir.dataflow.pass_edge", 1),
        )
        for mcu_addressing in (False, True)
    },
    **_proofs("sun"),
    **_proofs("nadir"),
}
