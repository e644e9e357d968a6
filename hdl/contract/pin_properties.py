"""What properties of several contracts have in common; none names a register of a design.

Time goes in steps, as in :mod:`cubestack.hdl.proofs.prover`. A design starts in any state, and in
standby for :data:`WARM_UP` pixel clocks.
"""

from types import SimpleNamespace

from amaranth.hdl import Assert, Assume, Cat, Const, Module, Mux, Signal, Value

from cubestack.hdl.contract.contract import Size
from cubestack.hdl.proofs import properties
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import domain, first_step

WARM_UP = 4


def starts_in_standby(m: Module, clock: Value, standby: Value) -> None:
    """While the pixel clock goes on."""
    sync = domain(m, "warm_up", clock, Const(0))
    clocks = Signal(range(WARM_UP + 1))
    m.d.comb += Assume(~first_step() | (clocks == 0))
    with m.If(clocks != WARM_UP):
        sync += clocks.eq(clocks + 1)
    m.d.comb += Assume(standby | (clocks == WARM_UP))


def camera_runs(m: Module, clock: Value, *lines: Value) -> None:
    """An edge of the pixel clock in each step; the camera's lines change while it is low."""
    m.d.comb += Assume(first_step() | (past(m, clock) != clock))
    m.d.comb += Assume(first_step() | ~clock | (Cat(lines) == past(m, Cat(lines))))


def camera_is_steady(m: Module, clock: Value, *lines: Value) -> None:
    """The camera's lines change with the falling clock only."""
    falls = ~clock & past(m, clock)
    m.d.comb += Assume(first_step() | falls | (Cat(lines) == past(m, Cat(lines))))


def whole_pulses(m: Module, d: SimpleNamespace, sram: str = "SRAM") -> None:
    properties.written_is_driven(m, d, sram)
    low = ~getattr(d, f"{sram}_WE_N")
    goes_on = low & past(m, low) & ~first_step()
    for bus in ("A", "D_O"):
        level = getattr(d, f"{sram}_{bus}")
        text = f"{sram}_{bus.partition('_')[0]} is stable while {sram}_WE_N is low"
        m.d.comb += Assert(~goes_on | (level == past(m, level)), text)


def is_not_written(m: Module, d: SimpleNamespace, when: Value, words: str, sram: str) -> None:
    m.d.comb += [
        Assert(~when | getattr(d, f"{sram}_WE_N"), f"{sram}_WE_N is high {words}"),
        Assert(~when | ~getattr(d, f"{sram}_D_OE"), f"no FPGA drives {sram}_D {words}"),
    ]


def rests(m: Module, d: SimpleNamespace, when: Value, sram: str = "SRAM") -> None:
    is_not_written(m, d, when, "in standby", sram)
    m.d.comb += [
        Assert(~when | getattr(d, f"{sram}_{name}"), f"{sram}_{name} is high in standby")
        for name in ("OE_N", "CE_N")
    ]


def writes_inside(m: Module, write_n: Value, position: tuple[Value, Value], size: Size) -> None:
    column, row = position
    m.d.comb += [
        Assert(write_n | (column < size.columns), "no write is beyond the last column"),
        Assert(write_n | (row < size.rows), "no write is beyond the last row"),
    ]


def acknowledges(
    m: Module,
    name: str,
    *,
    storing: Value,
    write_n: Value,
    position: tuple[Value, Value],
    ack: Value,
    size: Size,
) -> None:
    """Rows that are begun in order, each with its first column, and the last pixel at last."""
    column, row = position
    sync = domain(m, f"{name}_writes", ~write_n, ~storing)  # at the start of each pulse
    begun = Signal(range(size.rows + 1))
    last = Signal()
    with m.If(column == 0):
        sync += begun.eq(Mux(row == 0, 1, Mux(row == begun, begun + 1, 0)))
    with m.Elif(row + 1 != begun):
        sync += begun.eq(0)
    sync += last.eq((column == size.columns - 1) & (row == size.rows - 1))
    complete = last & (begun == size.rows) & write_n
    rises = ack & ~past(m, ack) & ~first_step()
    text = f"{name} rises after the last pixel of the last row is written"
    m.d.comb += Assert(~storing | ~rises | complete, text)


def byte_at(column: Value, row: Value) -> Value:
    """What the SRAM holds there, in a proof of reading."""
    return (Cat(column, row) + 1)[:8]


def reads_in_order(
    m: Module, d: SimpleNamespace, name: str, clock: Value, reading: Value, size: Size
) -> None:
    """The n-th data clock after ``reading`` has begun presents the n-th byte, while it lasts."""
    sync = domain(m, f"{name}_count", clock, ~reading)
    x, y = Signal(range(size.columns)), Signal(range(size.rows))
    wanted, any_clock = Signal(8), Signal()
    sync += [wanted.eq(byte_at(x, y)), any_clock.eq(1), x.eq(x + 1)]
    with m.If(x == size.columns - 1):
        sync += [x.eq(0), y.eq(Mux(y == size.rows - 1, 0, y + 1))]
    # In the step after the edge the SRAM presents the byte at a new address.
    steady = past(m, clock) == clock
    right = wanted == d.DATA
    m.d.comb += Assert(~any_clock | ~clock | steady | right, "a data clock presents its byte")


def data_clock_waits(m: Module, clock: Value, reading: Value) -> None:
    """The data clock has an edge in each step of reading, and none else."""
    was_reading = past(m, reading)
    m.d.comb += [
        Assume(~reading | ~was_reading | first_step() | (past(m, clock) != clock)),
        Assume(reading | ~clock),
        Assume(was_reading | ~clock),
    ]
