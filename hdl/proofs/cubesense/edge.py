"""Formal properties of CubeSense's edge data: nadir scan, Sun window and first Sun pixel."""

from functools import partial
from types import SimpleNamespace

from amaranth.hdl import Array, Assert, Cat, Module, Mux, Signal, Value

from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.proofs.cubesense.designs import column_row, fpga
from cubestack.hdl.proofs.properties import AUXILIARY, domain, starts_in, wires_below, writer_wires
from cubestack.hdl.proofs.prover import Proof, StuckWire

# Nadir scan: it visits exactly the declared addresses in order.

_SCAN = {
    "scan": "reader.scan",
    **wires_below("reader.scan", "on_a_line", "vertical", "along", "line"),
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
        # There is one preset between rows and columns; the columns repeat without one.
        sync += [pixel.eq(0), line.eq(0), columns.eq(1), preset.eq(~columns)]
    x = Mux(columns, Array(size.scan_columns)[line], pixel)
    y = Mux(columns, pixel, Array(size.scan_rows)[line])
    column, row = column_row(d)
    at_pixel = (column == x) & (row == y)
    m.d.comb += [
        Assert(~d.scan | Mux(preset, d.SRAM_A == 0, at_pixel), "SRAM_A is the scan's next pixel"),
        Assert((pixel < length) & (line < lines), AUXILIARY),
        Assert((d.on_a_line == ~preset) & (d.vertical == columns), AUXILIARY),
        Assert((d.along == pixel) & (d.line == line), AUXILIARY),
        Assert(~preset | ((pixel == 0) & (line == 0)), AUXILIARY),
    ]


# Sun window: it lies inside the image, around the first Sun pixel.

_WINDOW = {
    **{"window": "reader.window", "x": "reader.sun_x", "y": "reader.sun_y"},
    **wires_below("reader.window", "in_window", "state"),
    **{"right": "reader.window.right", "down": "reader.window.down"},
}


def _windows(m: Module, d: SimpleNamespace) -> None:
    """``ReadOut.window_origin`` for all coordinates, including "not found"."""
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
    fits = (left + size.window <= size.columns) & (top + size.window <= size.rows)
    column, row = column_row(d)
    at_pixel = (column == left + i) & (row == top + j)
    m.d.comb += [
        Assert(fits, "the window is inside of the picture"),
        Assert(~d.window | inside | (d.SRAM_A == 0), "SRAM_A is 0 before the window"),
        Assert(~d.window | ~inside | at_pixel, "SRAM_A is the window's next pixel"),
        Assert(clocks <= 4, AUXILIARY),
        Assert((i < size.window) & (j < size.window), AUXILIARY),
        Assert((d.in_window == inside) & (inside | (d.state == clocks)), AUXILIARY),
        Assert(inside | ((i == 0) & (j == 0)), AUXILIARY),
        Assert(d.right.as_signed() == i - size.window_left, AUXILIARY),
        Assert(d.down.as_signed() == j - size.window_above, AUXILIARY),
    ]


# First Sun pixel: the first of three adjacent bright pixels.

_SEARCH = wires_below("search", "x", "y", "awake", "searching", "run", "pixel")


def _searching(side: Side) -> dict[str, str]:
    """Wires of the search and of the writer that receives the sun camera's image."""
    writer, domain_name = ("pix_writer", "pix") if side == "sun" else ("link_writer", "link")
    wires = writer_wires("writer", domain_name, below=writer)
    return wires | _SEARCH | {"line_seen": f"{writer}.between_lines_seen"}


def _first_sun_pixel(side: Side, m: Module, d: SimpleNamespace) -> None:
    """Computed from addresses: bright pixels are adjacent if their columns follow in one row."""
    size = d.size
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.PCLK if side == "sun" else d.LINK_C_I[0], d.writer_rst)
    column, row, store = d.writer_column, d.writer_row, d.writer_store
    awake = Signal()
    began, found = Signal(), Signal()  # a search began since reset; it found the Sun
    sun_x, sun_y = Signal.like(column), Signal.like(row)
    count = Signal(range(SUN_RUN + 1))  # adjacent bright pixels up to the last one
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
    none_reported = Signal()  # not at the first clock after reset, which keeps the coordinates
    with m.If(start & awake):
        sync += none_reported.eq(1)
    one_before = (last_x + 1 == column) & (last_y == row)
    m.d.comb += [
        Assert(~found | shown, "the coordinates are those of the first three bright pixels"),
        Assert(~found | ((sun_x + SUN_RUN <= size.columns) & (sun_y < size.rows)), AUXILIARY),
        Assert(~none_reported | found | none, "without a Sun all bits of the coordinates are 1"),
        Assert((column < size.columns) & (row < size.rows), AUXILIARY),
        Assert(store | (column == 0), AUXILIARY),
        Assert(~store | (d.writer_line_open & ~d.writer_line_full & d.line_seen), AUXILIARY),
        Assert(~store | (~d.writer_frame_full & ~d.writer_ack), AUXILIARY),
        Assert((d.awake == awake) & (awake | ~began), AUXILIARY),
        Assert(began | (~found & ~none_reported), AUXILIARY),
        Assert(d.searching == (began & ~found), AUXILIARY),
        Assert(~d.searching | (d.run < SUN_RUN), AUXILIARY),
        Assert(~d.searching | ~store | (column == 0) | (d.run == count), AUXILIARY),
        Assert(~d.searching | ~store | (column != 0) | (d.run == 0), AUXILIARY),
        Assert(~store | (column == 0) | (count == 0) | one_before, AUXILIARY),
        Assert(~store | (column == 0) | (count <= column), AUXILIARY),
    ]


# As printed: the behaviour of the listing in appendix D.4.


def _keeps_coordinates(m: Module, d: SimpleNamespace) -> None:
    """The coordinates change only when a bright pixel is written, and become its position."""
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.PCLK, d.writer_rst)
    known, bright = Signal(), Signal()
    before, written = (Signal(d.size.address_bits, name=name) for name in ("before", "written"))
    now = Cat(d.x, d.y)
    sync += [
        known.eq(1),
        bright.eq(d.writer_store & (d.pixel >= SUN_THRESHOLD)),
        before.eq(now),
        written.eq(Cat(d.writer_column, d.writer_row)),
    ]
    m.d.comb += Assert(~known | (now == before) | (bright & (now == written)))


def _wraps(m: Module, d: SimpleNamespace) -> None:
    """After the first byte, whose address is old: row by row, modulo the width of the address."""
    size = d.size
    starts_in(m, d.EN)
    sync = domain(m, "monitor", d.CLK, ~d.window)
    clocks = Signal(range(6))  # for the coordinates and the window's first byte
    i, j = Signal(range(size.window)), Signal.like(d.y, name="j")
    begun = clocks == 5
    with m.If(~begun):
        sync += clocks.eq(clocks + 1)
    with m.If(clocks >= 4):
        sync += i.eq(Mux(i == size.window - 1, 0, i + 1))
        with m.If(i == size.window - 1):
            sync += j.eq(j + 1)
    column, row = column_row(d)
    x = (d.x - size.window_left + i)[: len(d.x)]
    y = (d.y - size.window_above + j)[: len(d.y)]
    m.d.comb += [
        Assert(~d.window | ~begun | ((column == x) & (row == y))),
        Assert(clocks <= 5, AUXILIARY),
        Assert((i < size.window) & (d.in_window == (clocks >= 4)), AUXILIARY),
        Assert((clocks >= 4) | (d.state == clocks), AUXILIARY),
        Assert(begun | ((j == 0) & (i == 0)), AUXILIARY),
        Assert(~d.window | (clocks == 0) | ((d.at_column == x) & (d.at_row == y)), AUXILIARY),
    ]


def _sends_only(m: Module, d: SimpleNamespace) -> None:
    """While the search runs on an image that is sent, the own memory is idle."""
    sending = ~d.EN & d.SHIFT & ~d.EDGE & ~d.RNW
    m.d.comb += Assert(~sending | (d.SRAM_CE_N & d.SRAM_WE_N & ~d.SRAM_D_OE & ~d.ACK))


def as_printed_proofs() -> dict[str, Proof]:
    """Proofs of the sun's FPGA; the nadir's differs only in the side of its camera."""
    make = fpga("sun", gateware="both-searches")
    at = {"at_column": "reader.window.column", "at_row": "reader.window.row"}
    window = {"window": "reader.window", "x": "reader.sun_x", "y": "reader.sun_y"}
    return {
        "sun-sends-only-one-search": Proof(
            "With one search the sun's FPGA writes nothing while it sends a picture",
            fpga("sun", gateware="one-search"),
            _sends_only,
            StuckWire("dataflow.store", 1),
        ),
        "sun-keeps-coordinates-as-printed": Proof(
            "As printed the coordinates stay until a bright pixel is written",
            make,
            _keeps_coordinates,
            StuckWire("search.store", 1),
            writer_wires("writer", "pix", below="pix_writer")
            | wires_below("search", "x", "y", "pixel"),
        ),
        "sun-window-as-printed": Proof(
            "As printed the Sun window wraps over the ends of the address",
            make,
            _wraps,
            StuckWire("reader.window.next_column", 3),
            {**window, **wires_below("reader.window", "in_window", "state"), **at},
        ),
    }


def edge_proofs(side: Side, mcu_addressing: bool = False) -> dict[str, Proof]:
    make = fpga(side, mcu_addressing)
    option = "-addressing" * mcu_addressing
    return {
        f"{side}-scan{option}": Proof(
            "The nadir scan visits exactly the declared addresses in order",
            make,
            _scans,
            StuckWire("reader.scan.line_ends", 0),
            _SCAN,
        ),
        f"{side}-window{option}": Proof(
            "The Sun window lies inside of the picture, around the first Sun pixel",
            make,
            _windows,
            StuckWire("reader.window.clamped_y", 3),
            _WINDOW,
        ),
        f"{side}-first-pixel{option}": Proof(
            "The first Sun pixel is the first of three bright ones side by side",
            make,
            partial(_first_sun_pixel, side),
            StuckWire("search.bright", 1),
            _searching(side),
        ),
    }
