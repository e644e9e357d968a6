"""What is proved of CubeStar's FPGA."""

from types import SimpleNamespace

from amaranth.hdl import Assert, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component
from amaranth.utils import ceil_log2

from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.proofs.properties import (
    acknowledges_all_rows,
    domain,
    idle_is_reset,
    starts_in,
    writer_wires,
)
from cubestack.hdl.proofs.prover import Fault, Proof

__all__ = ["PROOFS", "gapped", "inside"]


def gapped(small: bool) -> SimpleNamespace:
    """A size that is no power of two, so that the address could leave it; wide as the shipped."""
    columns, rows = (3, 3) if small else (1000, 500)
    return SimpleNamespace(columns=columns, rows=rows)


def inside(address: Value, size: SimpleNamespace) -> Value:
    """Whether row : column is within the picture."""
    bits = ceil_log2(size.columns)
    return (address[:bits] < size.columns) & (address[bits:] < size.rows)


def _gapped_top(small: bool) -> tuple[Component, SimpleNamespace]:
    size = gapped(small)
    return CubeStarTop(size.columns, size.rows), size


def _top(small: bool) -> tuple[Component, SimpleNamespace]:
    """The shipped size, or one so small that a counterexample takes a few clocks."""
    columns, rows = (3, 3) if small else (1024, 512)
    return CubeStarTop(columns, rows), SimpleNamespace(columns=columns, rows=rows)


def _address_stays_inside(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    for position in (d.written, d.read, d.SRAM_A[:-1]):
        m.d.comb += Assert(inside(position, d.size))


def _idle(m: Module, d: SimpleNamespace) -> None:
    standby = ~d.ENABLE
    position = d.SRAM_A[:-1]
    for level in (d.ACK, d.DATA, position, d.SRAM_D_O, d.SRAM_D_OE):
        m.d.comb += Assert(~standby | (level == 0))
    for level in (d.SRAM_CE_N, d.SRAM_OE_N, d.SRAM_WE_N):
        m.d.comb += Assert(~standby | level)
    idle_is_reset(m, d, standby, {"bank"})


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    size = d.size.columns, d.size.rows
    m.d.comb += Assert(acknowledges_all_rows(m, d, "writer", d.PIXCLK, *size) == d.ACK)


def _one_driver(m: Module, d: SimpleNamespace) -> None:
    """The SRAM drives its bus while its output enable is low."""
    m.d.comb += [
        Assert(~d.SRAM_D_OE | d.SRAM_OE_N),
        Assert(d.SRAM_WE_N | (d.SRAM_D_OE & ~d.SRAM_CE_N)),
    ]


def _reads_in_order(m: Module, d: SimpleNamespace) -> None:
    """Address of the n-th byte before the n-th data clock, and its byte after it."""
    starts_in(m, ~d.ENABLE)
    reading = d.ENABLE & d.RNW
    sync = domain(m, "monitor", d.DCLK, ~reading)
    column, row = Signal(range(d.size.columns)), Signal(range(d.size.rows))
    byte = Signal(8)
    last_column, last_row = column == d.size.columns - 1, row == d.size.rows - 1
    sync += [byte.eq(d.SRAM_D_I), column.eq(Mux(last_column, 0, column + 1))]
    with m.If(last_column):
        sync += row.eq(Mux(last_row, 0, row + 1))
    bits = len(column)
    address = (d.SRAM_A[:bits] == column) & (d.SRAM_A[bits:-1] == row)
    m.d.comb += [
        Assert(~reading | address),
        Assert(byte == d.DATA),
        Assert((d.column == column) & (d.row == row)),
    ]


#: By name.
PROOFS = {
    "cubestar-ack": Proof(
        "ACK is high exactly from when all rows of a frame are stored",
        _top,
        writer_wires("writer", "pix"),
        _acknowledges,
        Fault("writer.counter.last_row", 1),
    ),
    "cubestar-address": Proof(
        "The SRAM address never leaves the picture, at 1000 x 500 pixels, where it could",
        _gapped_top,
        {"written": "writer.address", "read": "reader.address"},
        _address_stays_inside,
        Fault("writer.counter.last_column", 0),
    ),
    "cubestar-drivers": Proof(
        "FPGA and SRAM never both drive the SRAM's data bus",
        _top,
        {},
        _one_driver,
        Fault("writer.store", 1),
    ),
    "cubestar-idle": Proof(
        "With ENABLE low every register but the bank is reset, and the bank rests",
        _top,
        {},
        _idle,
        Fault("writer.pix_rst", 0),
    ),
    "cubestar-read": Proof(
        "Each data clock presents the next byte, from the first one on",
        _top,
        {"column": "reader.counter.column", "row": "reader.counter.row"},
        _reads_in_order,
        Fault("reader.counter.last_column", 0),
    ),
}
