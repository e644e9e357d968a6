"""Formal properties of CubeSense's FPGAs on an I2C bus."""

from functools import partial
from types import SimpleNamespace

from amaranth.hdl import Assert, Module, Signal, Value
from amaranth.hdl._ast import Initial  # not among the public names, though documented as one

from cubesense_fpga_i2c.pair import CubeSenseI2cPair
from cubesense_fpga_i2c.pins import FPGA
from cubesense_fpga_i2c.register_table import ADDRESSES, GROUP_ADDRESS, command_of
from cubesense_fpga_i2c.top import CubeSenseI2cFpga
from cubestack.firmware_model.interface.cubesense.fpga import Action
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.proofs.cubesense.designs import DesignMaker, proof_design
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import (
    ACKNOWLEDGES,
    acknowledges,
    domain,
    idle_is_reset,
    one_sram_driver,
    outputs_rest,
    starts_in,
    writer_wires,
)
from cubestack.hdl.proofs.prover import Proof, StuckWire

_TARGET = (
    "addressing",
    "bit",
    "count",
    "group",
    "number",
    "numbering",
    "reading",
    "shift",
    "start_happened",
    "start_seen",
    "stop_happened",
    "stop_seen",
    "writing",
)
_PHASES = ("addressing", "numbering", "writing", "reading")


def _target_wires(fpga: str = "") -> dict[str, str]:
    """Wires of a target, and its command register, by their plain names."""
    below = f"{fpga}." if fpga else ""
    before = f"{fpga}_" if fpga else ""
    wires = {name: f"{below}registers.target.{name}" for name in _TARGET}
    wires["command"] = f"{below}registers.command"
    return {before + name: wire for name, wire in wires.items()}


def _fpga(side: Side) -> DesignMaker:
    return proof_design(partial(CubeSenseI2cFpga, side))


# Reset is idle, and so are the other pins in standby.


def _idle(side: Side, m: Module, d: SimpleNamespace) -> None:
    standby = Signal()
    commands = [byte for byte in range(16) if getattr(command_of(byte), side) is Action.STANDBY]
    m.d.comb += standby.eq(d.command.matches(*commands))
    starts_in(m, ~d.RESET_N)
    m.d.comb += Assert(d.RESET_N | (standby & ~d.SDA_OE))
    outputs_rest(m, d, standby, FPGA, but=["SDA_OE"])
    one_sram_driver(m, d)
    m.d.comb += Assert(~d.SDA_O)
    idle_is_reset(m, d, ~d.RESET_N, {"search.x", "search.y"})


# SDA is pulled low to acknowledge and to send a 0.


def _pulls_sda(side: Side, m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.RESET_N)
    sync = domain(m, "monitor", ~d.SCL, ~d.RESET_N)
    condition = (d.start_happened ^ d.start_seen) | (d.stop_happened ^ d.stop_seen)
    asked = Signal()  # the transfer is to this FPGA
    sent = Signal()  # a byte of its own is over, or half way
    with m.If(condition):
        sync += [asked.eq(0), sent.eq(0)]
    with m.Elif(d.addressing & (d.count == 7)):
        read, address = d.bit, d.shift[:7]
        own = address == ADDRESSES[side]
        sync += asked.eq(own | ((address == GROUP_ADDRESS) & ~read))
    with m.Elif(d.count == 8):
        sync += sent.eq(d.reading)
    acknowledges = (d.count == 8) & ~sent
    sends = d.reading & (d.count < 8) & ~d.shift[7]
    m.d.comb += [
        Assert(~d.SDA_OE | (asked & (acknowledges | sends))),
        Assert((past(m, d.SDA_OE) == d.SDA_OE) | ~d.SCL | ~d.RESET_N | Initial()),
        # What makes these inductive.
        *_one_phase(d),
        Assert(~(d.numbering | d.writing | d.reading) | asked),
        Assert(~sent | ~(d.addressing | d.numbering | d.writing)),
        Assert(d.count <= 8),
    ]


def _one_phase(d: SimpleNamespace, prefix: str = "") -> list[Value]:
    """At most one of the target's phases."""
    phases = [getattr(d, prefix + name) for name in _PHASES]
    return [
        Assert(~(one & other)) for index, one in enumerate(phases) for other in phases[index + 1 :]
    ]


# Both FPGAs have the same command, so the link has one driver.


_PAIR_WIRES = {
    **_target_wires("sun"),
    **_target_wires("nadir"),
    **{f"{side}_LINK_D_OE": f"{side}.LINK_D_OE" for side in SIDES},
}


def _one_driver(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.RESET_N)
    sun, nadir = (
        SimpleNamespace(**{name: getattr(d, f"{side}_{name}") for name in _target_wires()})
        for side in SIDES
    )

    def same(*names: str) -> Value:
        equal = [getattr(sun, name) == getattr(nadir, name) for name in names]
        result = equal[0]
        for each in equal[1:]:
            result &= each
        return result

    writing = ~sun.reading & ~nadir.reading
    m.d.comb += [
        Assert(d.CONTENTION == 0),
        Assert(same("command")),
        # What makes these inductive.
        Assert(same("bit", "count", "addressing", "group")),
        Assert(same("start_happened", "start_seen", "stop_happened", "stop_seen")),
        *_one_phase(d, "sun_"),
        *_one_phase(d, "nadir_"),
        Assert(~sun.group | sun.addressing | (writing & same("numbering", "writing"))),
        Assert(~sun.group | ~sun.writing | same("number")),
        Assert(sun.count <= 8),
    ]
    for bit in range(8):
        received = writing & (sun.count > bit)
        m.d.comb += Assert(~received | (sun.shift[bit] == nadir.shift[bit]))
    # Each value of the command, listed or not, turns on the drivers that it should.
    for byte in range(16):
        here = sun.command == byte
        for side, prefix in PREFIXES.items():
            action = getattr(command_of(byte), side)
            sends = getattr(d, f"{side}_LINK_D_OE") == (action is Action.SEND_PICTURE)
            reads = getattr(d, f"{prefix}SRAM_OE_N") == (action is not Action.READ)
            m.d.comb += Assert(~here | (sends & reads))
    for prefix in PREFIXES.values():
        one_sram_driver(m, d, f"{prefix}SRAM")


# ACK exactly when all rows are stored.

_WRITERS = {
    **writer_wires("pix_writer", "pix"),
    **writer_wires("link_writer", "link"),
    **{name: f"registers.{name}" for name in ("ack", "store", "store_other")},
}


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    # The bus may be anywhere, so that a counterexample needs no transfer of its own.
    starts_in(m, ~d.store & ~d.store_other)
    acknowledges(m, d, d.ack, pix_writer=d.PCLK, link_writer=d.LINK_C_I[0])


def _proofs(side: Side) -> dict[str, Proof]:
    """Of one of the two FPGAs."""
    return {
        f"{side}-idle-i2c": Proof(
            "With RESET_N low every register but the Sun's coordinates is reset; in standby every "
            "pin but SDA is",
            _fpga(side),
            partial(_idle, side),
            StuckWire("pix_writer.pix_rst" if side == "sun" else "link_writer.link_rst", 0),
            _target_wires(),
        ),
        f"{side}-sda-i2c": Proof(
            "SDA is pulled low in transfers to this FPGA only, to acknowledge or to send a 0, and "
            "never moved while SCL is high",
            _fpga(side),
            partial(_pulls_sda, side),
            StuckWire("registers.target.reading", 1),
            _target_wires(),
        ),
        f"{side}-ack-i2c": Proof(
            ACKNOWLEDGES, _fpga(side), _acknowledges, StuckWire("pix_writer.ack", 1), _WRITERS
        ),
    }


#: By name.
PROOFS = {
    "pair-drivers-i2c": Proof(
        "Both FPGAs have the same command, which turns on the drivers that it should, and no wire "
        "has two",
        proof_design(CubeSenseI2cPair),
        _one_driver,
        StuckWire("nadir.registers.target.group", 1),
        _PAIR_WIRES,
    ),
    **_proofs("sun"),
    **_proofs("nadir"),
}
