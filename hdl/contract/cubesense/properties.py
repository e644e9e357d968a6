"""CubeSense's handshake as properties of the pair's pins; none names a register of the design."""

from collections.abc import Collection, Iterator
from types import SimpleNamespace

from amaranth.hdl import Assert, Assume, Cat, Module, Value

from cubestack.firmware_model.interface.cubesense.fpga import Action, settled_rows
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract import pin_properties as pins
from cubestack.hdl.contract.contract import Property
from cubestack.hdl.proofs.cubesense.pins import PRESENTS, at_levels, drivers
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import first_step

_STANDBY = {Action.STANDBY}
_STORES = {Action.STORE, Action.STORE_OTHER}
_READS = {Action.READ, Action.EDGE, Action.SEND_EDGE}


def _sides(d: SimpleNamespace) -> Iterator[tuple[str, str, Value]]:
    """Side, its SRAM and its ACK."""
    for side, prefix in PREFIXES.items():
        yield str(side), f"{prefix}SRAM", getattr(d, f"{prefix.rstrip('_')}ACK")


def _during(d: SimpleNamespace, side: str, wanted: Collection[Action]) -> Value:
    rows = [levels for levels, row in settled_rows() if getattr(row, side) in wanted]
    return Cat(at_levels(d, levels) for levels in rows).any()


def _standby(m: Module, d: SimpleNamespace) -> None:
    """Also at levels that are no row of the command table."""
    for side, sram, ack in _sides(d):
        standby = _during(d, side, _STANDBY)
        pins.rests(m, d, standby, sram)
        m.d.comb += Assert(~standby | ~ack, f"the {side} ACK is low in standby")


def _reading(m: Module, d: SimpleNamespace) -> None:
    words = "while an image is read"
    for side, sram, ack in _sides(d):
        reading = _during(d, side, _READS)
        pins.is_not_written(m, d, reading, words, sram)
        m.d.comb += [
            Assert(~reading | ~ack, f"the {side} ACK is low {words}"),
            Assert(~reading | ~getattr(d, f"{sram}_OE_N"), f"{sram}_OE_N is low {words}"),
        ]


def _presents(m: Module, d: SimpleNamespace) -> None:
    for levels, row in settled_rows():
        driven = bool(PRESENTS & {*row}) == d.DATA_OE
        text = f"DATA is driven only where bytes are presented, at levels {levels}"
        m.d.comb += Assert(~at_levels(d, levels) | driven, text)
    held = Cat(d.SHIFT, d.EDGE, d.RNW, d.SUNEN, d.NADEN)
    goes_on = ~first_step() & (held == past(m, held)) & d.DATA_OE & (~d.CLK | past(m, d.CLK))
    for side in map(str, PREFIXES):
        steady = goes_on & _during(d, side, {Action.READ, Action.EDGE})
        text = "DATA stays until the next data clock"
        m.d.comb += Assert(~steady | (past(m, d.DATA) == d.DATA), text)


def _pulses(m: Module, d: SimpleNamespace) -> None:
    for prefix, (_, sram, _) in zip(PREFIXES.values(), _sides(d), strict=True):
        clock, href, pixel = (getattr(d, prefix + name) for name in ("PCLK", "HREF", "Y"))
        pins.camera_is_steady(m, clock, href, pixel)
        pins.whole_pulses(m, d, sram)


def _starts(m: Module, d: SimpleNamespace) -> None:
    """Both cameras have one clock; a command comes at once, and stays."""
    standby = d.SUNEN & d.NADEN
    m.d.comb += Assume(d.SUN_PCLK == d.NAD_PCLK)
    pins.starts_in_standby(m, d.SUN_PCLK, standby)
    lines = Cat(d.SHIFT, d.EDGE, d.RNW)
    held = (lines == past(m, lines)) & (~d.SUNEN | past(m, d.SUNEN))
    came = past(m, standby) | (past(m, d.NADEN) == d.NADEN)
    m.d.comb += Assume(first_step() | (held & came & (~d.NADEN | past(m, d.NADEN))))


def _one_store(m: Module, d: SimpleNamespace) -> None:
    _starts(m, d)
    pins.camera_runs(m, d.SUN_PCLK, d.SUN_HREF, d.NAD_HREF)
    dark = (d.SUN_Y == 0) & (d.NAD_Y == 0) & (d.SUN_SRAM_D_I == 0) & (d.NAD_SRAM_D_I == 0)
    m.d.comb += Assume(d.SUN_HREF == d.NAD_HREF)
    m.d.comb += Assume(~d.CLK & ~(d.EDGE | (d.RNW & ~d.SHIFT)) & dark)


def _inside(m: Module, d: SimpleNamespace) -> None:
    _one_store(m, d)
    for _, sram, _ in _sides(d):
        pins.writes_inside(m, getattr(d, f"{sram}_WE_N"), _position(d, sram), d.size)


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    _one_store(m, d)
    for side, sram, ack in _sides(d):
        pins.acknowledges(
            m,
            f"{sram.partition('_')[0]}ACK",
            storing=_during(d, side, _STORES),
            write_n=getattr(d, f"{sram}_WE_N"),
            position=_position(d, sram),
            ack=ack,
            size=d.size,
        )


def _reads(m: Module, d: SimpleNamespace) -> None:
    """SRAMs whose bytes are their positions; the cameras stand still while one is read."""
    _starts(m, d)
    goes_on = ~(d.SUNEN & d.NADEN) & ~past(m, d.SUNEN & d.NADEN)
    m.d.comb += Assume(~goes_on | first_step() | (past(m, d.SUN_PCLK) == d.SUN_PCLK))
    m.d.comb += Assume(~d.SHIFT & ~d.EDGE & d.RNW & (d.SUNEN | d.NADEN))
    reading = ~(d.SUNEN & d.NADEN)
    pins.data_clock_waits(m, d.CLK, reading)
    for side, sram, _ in _sides(d):
        m.d.comb += Assume(pins.byte_at(*_position(d, sram)) == getattr(d, f"{sram}_D_I"))
        pins.reads_in_order(m, d, side, d.CLK, _during(d, side, {Action.READ}), d.size)


def _position(d: SimpleNamespace, sram: str) -> tuple[Value, Value]:
    bits = (d.size.columns - 1).bit_length()
    address = getattr(d, f"{sram}_A")
    return address[:bits], address[bits:]


PROPERTIES = {
    "one-driver": Property("No wire has two drivers", drivers),
    "standby": Property(
        "In standby, and at levels that are no command, no pin is active", _standby
    ),
    "no-write-while-reading": Property("While an image is read nothing is written", _reading),
    "presents": Property(
        "DATA is driven exactly at the commands that read, and changes with the data clock only",
        _presents,
    ),
    "whole-pulses": Property("Address and data are stable in each write pulse", _pulses, steps=6),
    "inside": Property("Writes stay inside of the image", _inside, steps=30),
    "ack": Property(
        "ACK rises only after all rows of a frame are written in order", _acknowledges, steps=24
    ),
    "read": Property("The n-th data clock presents the n-th byte", _reads),
}
