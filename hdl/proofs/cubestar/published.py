"""Formal properties of CubeStar's published board."""

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

from amaranth.hdl import Assert, Module, Mux, Signal, Value
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.cubestar.pins import PUBLISHED
from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.cubestar.board import CubeStarBoard
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.proofs import properties
from cubestack.hdl.proofs.properties import AUXILIARY, starts_in, wires_below
from cubestack.hdl.proofs.prover import Proof, StuckWire
from cubestack.hdl.proofs.strides import stride_proof

Make = Callable[[bool], tuple[CubeStarBoard, SimpleNamespace]]


def _sized_design(
    design: type[CubeStarBoard], columns: int, rows: int, small: bool
) -> tuple[CubeStarBoard, SimpleNamespace]:
    """The design at a size, or small enough that a counterexample takes a few clocks."""
    size = SimpleNamespace(columns=3 if small else columns, rows=3 if small else rows)
    return design(size.columns, size.rows), size


def full(design: type[CubeStarBoard]) -> Make:
    """Creates the design at its shipped size."""
    return partial(_sized_design, design, 1024, 512)


def gapped(design: type[CubeStarBoard]) -> Make:
    """Creates it as wide as shipped, but not a power of two, so that the address could leave it."""
    return partial(_sized_design, design, 1000, 500)


def inside(address: Value, size: SimpleNamespace) -> Value:
    bits = ceil_log2(size.columns)
    return (address[:bits] < size.columns) & (address[bits:] < size.rows)


def _address_stays_inside(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    m.d.comb += [
        Assert(inside(d.written, d.size), AUXILIARY),
        Assert(inside(d.read, d.size), AUXILIARY),
        Assert(inside(d.SRAM_A[:-1], d.size), "SRAM_A is inside of the picture"),
    ]


def bank_rests(pins: tuple[Pin, ...], m: Module, d: SimpleNamespace) -> None:
    """Standby of any board with one memory of two banks."""
    standby = ~d.ENABLE
    properties.outputs_rest(m, d, standby, pins, but=["SRAM_A"])
    m.d.comb += Assert(~standby | (d.SRAM_A[:-1] == 0), "in standby SRAM_A is 0 but for the bank")
    properties.idle_is_reset(m, d, standby, {"bank"})


def ack_is_right(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    properties.acknowledges(m, d, d.ACK, writer=d.PIXCLK)


def _reads_in_order(m: Module, d: SimpleNamespace) -> None:
    """The n-th byte's address before the n-th data clock, and the byte after it."""
    starts_in(m, ~d.ENABLE)
    reading = d.ENABLE & d.RNW
    sync = properties.domain(m, "monitor", d.DCLK, ~reading)
    column, row = Signal(range(d.size.columns)), Signal(range(d.size.rows))
    byte = Signal(8)
    last_column, last_row = column == d.size.columns - 1, row == d.size.rows - 1
    sync += [byte.eq(d.SRAM_D_I), column.eq(Mux(last_column, 0, column + 1))]
    with m.If(last_column):
        sync += row.eq(Mux(last_row, 0, row + 1))
    bits = len(column)
    address = (d.SRAM_A[:bits] == column) & (d.SRAM_A[bits:-1] == row)
    m.d.comb += [
        Assert(~reading | address, "before the n-th data clock SRAM_A is that of the n-th pixel"),
        Assert(byte == d.DATA, "DATA is the byte of the last data clock, and 0 before the first"),
        Assert((d.column == column) & (d.row == row), AUXILIARY),
    ]


#: Wires of a board's only writer.
WRITER = properties.writer_wires("writer", "pix")
LAST_ROW = StuckWire("writer.counter.last_row", 1)
LAST_COLUMN = StuckWire("writer.counter.last_column", 0)
ROW_ENDS = StuckWire("writer.counter.last_column", 1)

BANK_RESTS = "With ENABLE low every register but the bank is reset, and the bank rests"

PROOFS = {
    "cubestar-ack": Proof(
        properties.ACKNOWLEDGES, full(CubeStarTop), ack_is_right, LAST_ROW, WRITER
    ),
    "cubestar-address": Proof(
        "The SRAM address never leaves the picture, at 1000 x 500 pixels, where it could",
        gapped(CubeStarTop),
        _address_stays_inside,
        LAST_COLUMN,
        {"written": "writer.address", "read": "reader.address"},
    ),
    "cubestar-drivers": Proof(
        "FPGA and SRAM never both drive the SRAM's data bus",
        full(CubeStarTop),
        properties.written_is_driven,
        StuckWire("writer.store", 1),
    ),
    "cubestar-idle": Proof(
        BANK_RESTS,
        full(CubeStarTop),
        partial(bank_rests, PUBLISHED),
        StuckWire("writer.pix_rst", 0),
    ),
    "cubestar-read": Proof(
        "Each data clock presents the next byte, from the first one on",
        full(CubeStarTop),
        _reads_in_order,
        StuckWire("reader.counter.last_column", 0),
        wires_below("reader.counter", "column", "row"),
    ),
    "cubestar-row": stride_proof(full(CubeStarTop), ROW_ENDS, "row"),
    "cubestar-row-read": stride_proof(
        full(CubeStarTop), StuckWire("reader.counter.last_column", 1), "row-read"
    ),
}
