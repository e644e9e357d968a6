"""CubeStar's handshake as properties of its pins; none names a register of the design.

A design may react :data:`LATENCY` pixel clocks late.
"""

from types import SimpleNamespace

from amaranth.hdl import Assert, Assume, Module, Signal, Value

from cubestack.hdl.contract import pin_properties as pins
from cubestack.hdl.contract.contract import Property
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import domain, first_step, one_sram_driver

LATENCY = 5


def _starts(m: Module, d: SimpleNamespace) -> None:
    pins.starts_in_standby(m, d.PIXCLK, ~d.ENABLE)


def _camera_runs(m: Module, d: SimpleNamespace) -> None:
    pins.camera_runs(m, d.PIXCLK, d.PIXDATA, d.HSYNC, d.VSYNC)


def _one_store(m: Module, d: SimpleNamespace) -> None:
    """The microcontroller requests an image and waits; only the camera's lines and BANK change."""
    _starts(m, d)
    _camera_runs(m, d)
    m.d.comb += [
        Assume(~d.DCLK & ~d.RNW),
        Assume(first_step() | d.ENABLE | ~past(m, d.ENABLE)),
        Assume((d.PIXDATA == 0) & (d.SRAM_D_I == 0)),
    ]


def _settled(m: Module, d: SimpleNamespace, name: str, mode: Value) -> Value:
    """High once ``mode`` has lasted for the latency."""
    _starts(m, d)
    _camera_runs(m, d)
    sync = domain(m, f"{name}_clocks", d.PIXCLK, ~mode)
    clocks = Signal(range(LATENCY + 1), name=f"{name}_clocks")
    with m.If(clocks != LATENCY):
        sync += clocks.eq(clocks + 1)
    return mode & (clocks == LATENCY)


def _pulses(m: Module, d: SimpleNamespace) -> None:
    _starts(m, d)
    pins.camera_is_steady(m, d.PIXCLK, d.PIXDATA, d.HSYNC, d.VSYNC)
    pins.whole_pulses(m, d)


def _standby(m: Module, d: SimpleNamespace) -> None:
    settled = _settled(m, d, "standby", ~d.ENABLE)
    pins.rests(m, d, settled)
    m.d.comb += Assert(~settled | ~d.ACK, "ACK is low in standby")


def _reading(m: Module, d: SimpleNamespace) -> None:
    settled = _settled(m, d, "reading", d.ENABLE & d.RNW)
    pins.is_not_written(m, d, settled, "while an image is read", "SRAM")
    m.d.comb += [
        Assert(~settled | ~d.ACK, "ACK is low while an image is read"),
        Assert(~settled | ~d.SRAM_OE_N, "SRAM_OE_N is low while an image is read"),
    ]


def _inside(m: Module, d: SimpleNamespace) -> None:
    _one_store(m, d)
    sync = domain(m, "latch", d.ENABLE, d.NEVER)
    bank, known = Signal(), Signal()
    sync += [bank.eq(d.BANK), known.eq(1)]
    m.d.comb += Assume(~first_step() | ~known)
    pins.writes_inside(m, d.SRAM_WE_N, _position(d), d.size)
    text = "each write is in the bank that BANK was when ENABLE rose"
    m.d.comb += Assert(d.SRAM_WE_N | ~known | (d.SRAM_A[-1] == bank), text)


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    _one_store(m, d)
    storing = d.ENABLE & ~d.RNW
    pins.acknowledges(
        m,
        "ACK",
        storing=storing,
        write_n=d.SRAM_WE_N,
        position=_position(d),
        ack=d.ACK,
        size=d.size,
    )


def _reads(m: Module, d: SimpleNamespace) -> None:
    """An SRAM whose bytes are their positions; no camera."""
    _starts(m, d)
    goes_on = d.ENABLE & past(m, d.ENABLE)
    m.d.comb += Assume(~goes_on | first_step() | (past(m, d.PIXCLK) == d.PIXCLK))
    m.d.comb += Assume(pins.byte_at(*_position(d)) == d.SRAM_D_I)
    reading = d.ENABLE & d.RNW
    pins.data_clock_waits(m, d.DCLK, reading)
    pins.reads_in_order(m, d, "read", d.DCLK, reading, d.size)


def _position(d: SimpleNamespace) -> tuple[Value, Value]:
    bits = (d.size.columns - 1).bit_length()
    return d.SRAM_A[:bits], d.SRAM_A[bits:-1]


PROPERTIES = {
    "one-driver": Property("FPGA and SRAM never both drive the SRAM's data bus", one_sram_driver),
    "whole-pulses": Property("Address and data are stable in each write pulse", _pulses),
    "standby": Property("In standby no pin is active", _standby),
    "no-write-while-reading": Property("While an image is read nothing is written", _reading),
    "inside": Property("Writes stay inside of the image, in the latched bank", _inside, steps=30),
    "ack": Property("ACK rises only after all rows of a frame are written in order", _acknowledges),
    "read": Property("The n-th data clock presents the n-th byte", _reads),
}
