"""CubeStar's handshake as properties of its pins; none names a register of the design.

Time goes in steps, as in :mod:`cubestack.hdl.proofs.prover`. A design starts in any state, and in
standby for :data:`WARM_UP` pixel clocks. It may react :data:`LATENCY` pixel clocks late.
"""

from types import SimpleNamespace

from amaranth.hdl import Assert, Assume, Cat, Module, Mux, Signal, Value

from cubestack.hdl.contract.contract import Property
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import domain, first_step

WARM_UP = 4
LATENCY = 5


def _starts(m: Module, d: SimpleNamespace) -> None:
    """Standby at first, while the pixel clock goes on."""
    sync = domain(m, "warm_up", d.PIXCLK, d.NEVER)
    clocks = Signal(range(WARM_UP + 1))
    m.d.comb += Assume(~first_step() | (clocks == 0))
    with m.If(clocks != WARM_UP):
        sync += clocks.eq(clocks + 1)
    m.d.comb += Assume(~d.ENABLE | (clocks == WARM_UP))


def _camera_runs(m: Module, d: SimpleNamespace) -> None:
    """An edge of the pixel clock in each step; its data changes while it is low."""
    m.d.comb += Assume(first_step() | (past(m, d.PIXCLK) != d.PIXCLK))
    camera = Cat(d.PIXDATA, d.HSYNC, d.VSYNC)
    m.d.comb += Assume(first_step() | ~d.PIXCLK | (camera == past(m, camera)))


def _one_store(m: Module, d: SimpleNamespace) -> None:
    """The microcontroller requests an image and waits; only the camera's lines and BANK change."""
    m.d.comb += [
        Assume(~d.DCLK & ~d.RNW),
        Assume(first_step() | d.ENABLE | ~past(m, d.ENABLE)),
        Assume((d.PIXDATA == 0) & (d.SRAM_D_I == 0)),
    ]


def _settled(m: Module, d: SimpleNamespace, name: str, mode: Value) -> Value:
    """High once ``mode`` has lasted for the latency."""
    sync = domain(m, f"{name}_clocks", d.PIXCLK, ~mode)
    clocks = Signal(range(LATENCY + 1), name=f"{name}_clocks")
    with m.If(clocks != LATENCY):
        sync += clocks.eq(clocks + 1)
    return mode & (clocks == LATENCY)


def _drivers(m: Module, d: SimpleNamespace) -> None:
    text = "FPGA and SRAM both drive SRAM_D"
    m.d.comb += Assert(~d.SRAM_D_OE | d.SRAM_OE_N, text)


def _pulses(m: Module, d: SimpleNamespace) -> None:
    low = ~d.SRAM_WE_N
    goes_on = low & past(m, low) & ~first_step()
    address, data = past(m, d.SRAM_A), past(m, d.SRAM_D_O)
    _starts(m, d)
    camera = Cat(d.PIXDATA, d.HSYNC, d.VSYNC)
    falls = ~d.PIXCLK & past(m, d.PIXCLK)
    m.d.comb += Assume(first_step() | falls | (camera == past(m, camera)))
    m.d.comb += [
        Assert(~low | d.SRAM_D_OE, "SRAM_WE_N is low while the FPGA does not drive SRAM_D"),
        Assert(~low | ~d.SRAM_CE_N, "SRAM_WE_N is low while SRAM_CE_N is high"),
        Assert(~goes_on | (address == d.SRAM_A), "SRAM_A changes while SRAM_WE_N is low"),
        Assert(~goes_on | (data == d.SRAM_D_O), "SRAM_D changes while SRAM_WE_N is low"),
    ]


def _standby(m: Module, d: SimpleNamespace) -> None:
    _starts(m, d)
    _camera_runs(m, d)
    settled = _settled(m, d, "standby", ~d.ENABLE)
    m.d.comb += [
        Assert(~settled | ~d.ACK, "ACK is high in standby"),
        Assert(~settled | d.SRAM_WE_N, "SRAM_WE_N is low in standby"),
        Assert(~settled | d.SRAM_OE_N, "SRAM_OE_N is low in standby"),
        Assert(~settled | d.SRAM_CE_N, "SRAM_CE_N is low in standby"),
        Assert(~settled | ~d.SRAM_D_OE, "the FPGA drives SRAM_D in standby"),
    ]


def _reading(m: Module, d: SimpleNamespace) -> None:
    _starts(m, d)
    _camera_runs(m, d)
    settled = _settled(m, d, "reading", d.ENABLE & d.RNW)
    m.d.comb += [
        Assert(~settled | d.SRAM_WE_N, "SRAM_WE_N is low while an image is read"),
        Assert(~settled | ~d.SRAM_D_OE, "the FPGA drives SRAM_D while an image is read"),
        Assert(~settled | ~d.ACK, "ACK is high while an image is read"),
        Assert(~settled | ~d.SRAM_OE_N, "SRAM_OE_N is high while an image is read"),
    ]


def _inside(m: Module, d: SimpleNamespace) -> None:
    _starts(m, d)
    _camera_runs(m, d)
    _one_store(m, d)
    column, row = _position(d)
    sync = domain(m, "latch", d.ENABLE, d.NEVER)
    bank, known = Signal(), Signal()
    sync += [bank.eq(d.BANK), known.eq(1)]
    m.d.comb += Assume(~first_step() | ~known)
    low = ~d.SRAM_WE_N
    m.d.comb += [
        Assert(~low | (column < d.size.columns), "a write beyond the last column"),
        Assert(~low | (row < d.size.rows), "a write beyond the last row"),
        Assert(
            ~low | ~known | (d.SRAM_A[-1] == bank),
            "a write in another bank than BANK was when ENABLE rose",
        ),
    ]


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    """Rows that are begun in order, each with its first column, and the last pixel at last."""
    _starts(m, d)
    _camera_runs(m, d)
    _one_store(m, d)
    column, row = _position(d)
    sync = domain(m, "writes", ~d.SRAM_WE_N, ~d.ENABLE | d.RNW)  # at the start of each pulse
    begun = Signal(range(d.size.rows + 1))
    last = Signal()
    with m.If(column == 0):
        sync += begun.eq(Mux(row == 0, 1, Mux(row == begun, begun + 1, 0)))
    with m.Elif(row + 1 != begun):
        sync += begun.eq(0)
    sync += last.eq((column == d.size.columns - 1) & (row == d.size.rows - 1))
    complete = last & (begun == d.size.rows) & d.SRAM_WE_N
    storing = d.ENABLE & ~d.RNW
    rises = d.ACK & ~past(m, d.ACK) & ~first_step()
    m.d.comb += Assert(
        ~storing | ~rises | complete, "ACK rises before the last pixel of the last row is written"
    )


def _reads(m: Module, d: SimpleNamespace) -> None:
    """An SRAM whose bytes are their positions; no camera."""
    _starts(m, d)
    clocks = past(m, d.ENABLE)
    m.d.comb += Assume(~d.ENABLE | ~clocks | first_step() | (past(m, d.PIXCLK) == d.PIXCLK))
    column, row = _position(d)
    bits = len(column)
    m.d.comb += Assume(_byte(column, row) == d.SRAM_D_I)
    reading = d.ENABLE & d.RNW
    edges = Assume(~reading | ~past(m, reading) | first_step() | (past(m, d.DCLK) != d.DCLK))
    m.d.comb += [edges, Assume(reading | ~d.DCLK), Assume(past(m, reading) | ~d.DCLK)]
    sync = domain(m, "count", d.DCLK, ~reading)
    x, y = Signal(bits), Signal(len(row))
    wanted, any_clock = Signal(8), Signal()
    sync += [wanted.eq(_byte(x, y)), any_clock.eq(1), x.eq(x + 1)]
    with m.If(x == d.size.columns - 1):
        sync += [x.eq(0), y.eq(Mux(y == d.size.rows - 1, 0, y + 1))]
    # In the step after the edge the SRAM presents the byte at a new address.
    steady = past(m, d.DCLK) == d.DCLK
    m.d.comb += Assert(
        ~any_clock | ~d.DCLK | steady | (wanted == d.DATA), "a data clock presents a wrong byte"
    )


def _position(d: SimpleNamespace) -> tuple[Value, Value]:
    bits = (d.size.columns - 1).bit_length()
    return d.SRAM_A[:bits], d.SRAM_A[bits:-1]


def _byte(column: Value, row: Value) -> Value:
    return (Cat(column, row) + 1)[:8]


PROPERTIES = {
    "one-driver": Property("FPGA and SRAM never both drive the SRAM's data bus", _drivers),
    "whole-pulses": Property("Address and data are stable in each write pulse", _pulses),
    "standby": Property("In standby no pin is active", _standby),
    "no-write-while-reading": Property("While an image is read nothing is written", _reading),
    "inside": Property("Writes stay inside of the image, in the latched bank", _inside, steps=30),
    "ack": Property("ACK rises only after all rows of a frame are written in order", _acknowledges),
    "read": Property("The n-th data clock presents the n-th byte", _reads),
}
