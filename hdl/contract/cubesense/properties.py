"""CubeSense's rules of drivers and memories as properties of the pair's pins."""

from types import SimpleNamespace

from amaranth.hdl import Assert, Module

from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract.contract import Property
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import first_step


def _drivers(m: Module, d: SimpleNamespace) -> None:
    m.d.comb += Assert(d.CONTENTION == 0, "two FPGAs drive one wire")
    for prefix in PREFIXES.values():
        driven, read_n = getattr(d, f"{prefix}SRAM_D_OE"), getattr(d, f"{prefix}SRAM_OE_N")
        m.d.comb += Assert(~driven | read_n, f"FPGA and SRAM both drive {prefix}SRAM_D")


def _standby(m: Module, d: SimpleNamespace) -> None:
    standby = d.SUNEN & d.NADEN
    for prefix in PREFIXES.values():
        for name, active in (("D_OE", 1), ("CE_N", 0), ("OE_N", 0), ("WE_N", 0)):
            pin = f"{prefix}SRAM_{name}"
            m.d.comb += Assert(
                ~standby | (getattr(d, pin) != active), f"{pin} is active in standby"
            )
    m.d.comb += [
        Assert(~standby | ~d.SUNACK, "SUNACK is high in standby"),
        Assert(~standby | ~d.NADACK, "NADACK is high in standby"),
        Assert(~standby | ~d.DATA_OE, "an FPGA drives DATA in standby"),
    ]


def _reading(m: Module, d: SimpleNamespace) -> None:
    reading = d.RNW & ~d.SHIFT
    for prefix in PREFIXES.values():
        pin = f"{prefix}SRAM_WE_N"
        m.d.comb += Assert(~reading | getattr(d, pin), f"{pin} is low while an image is read")


def _pulses(m: Module, d: SimpleNamespace) -> None:
    for prefix in PREFIXES.values():
        pins = {name: getattr(d, f"{prefix}SRAM_{name}") for name in ("A", "D_OE", "CE_N", "WE_N")}
        low = ~pins["WE_N"]
        m.d.comb += [
            Assert(~low | pins["D_OE"], f"{prefix}SRAM_WE_N is low while nothing drives the data"),
            Assert(~low | ~pins["CE_N"], f"{prefix}SRAM_WE_N is low without chip enable"),
        ]
        goes_on = low & past(m, low) & ~first_step()
        same = pins["A"] == past(m, pins["A"])
        m.d.comb += Assert(~goes_on | same, f"{prefix}SRAM_A changes while SRAM_WE_N is low")


PROPERTIES = {
    "one-driver": Property("No wire has two drivers", _drivers),
    "standby": Property("In standby no pin is active", _standby),
    "no-write-while-reading": Property("While an image is read nothing is written", _reading),
    "whole-pulses": Property("The address is stable in each write pulse", _pulses, steps=6),
}
