"""Formal properties of CubeSense's FPGAs."""

from collections.abc import Collection
from functools import partial
from types import SimpleNamespace

from amaranth.hdl import Assert, Cat, Const, Module, Mux, Signal

from cubestack.firmware_model.interface.cubesense import fpga as table
from cubestack.firmware_model.interface.cubesense.fpga import ADDRESS_BYTES, Action
from cubestack.firmware_model.interface.cubesense.pins import FPGA
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.proofs import properties
from cubestack.hdl.proofs.cubesense import pins
from cubestack.hdl.proofs.cubesense.designs import DesignMaker, column_row, fpga, proof_design
from cubestack.hdl.proofs.cubesense.edge import as_printed_proofs, edge_proofs
from cubestack.hdl.proofs.properties import AUXILIARY, starts_in, wires_below, writer_wires
from cubestack.hdl.proofs.prover import Proof, StuckWire
from cubestack.hdl.proofs.strides import stride_proof

# The address never leaves the image.

_COUNTERS = {
    "own": "pix_writer.counter",
    "link": "link_writer.counter",
    "picture": "reader.picture",
}
_POSITIONS = {
    **{f"{source}_{n}": f"{c}.{n}" for source, c in _COUNTERS.items() for n in ("column", "row")},
    **wires_below("reader.scan", "along", "line", "vertical"),
    **{"right": "reader.window.right", "down": "reader.window.down"},
}


def _address_stays_inside(m: Module, d: SimpleNamespace) -> None:
    size = d.size
    starts_in(m, d.EN)
    for source in _COUNTERS:
        m.d.comb += [
            Assert(getattr(d, f"{source}_column") < size.columns, AUXILIARY),
            Assert(getattr(d, f"{source}_row") < size.rows, AUXILIARY),
        ]
    m.d.comb += [
        Assert(d.along < Mux(d.vertical, size.rows, size.columns), AUXILIARY),
        Assert(d.line < Mux(d.vertical, len(size.scan_columns), len(size.scan_rows)), AUXILIARY),
    ]
    for position, before in ((d.right, size.window_left), (d.down, size.window_above)):
        m.d.comb += [
            Assert(position.as_signed() >= -before, AUXILIARY),
            Assert(position.as_signed() < size.window - before, AUXILIARY),
        ]
    column, row = column_row(d)
    m.d.comb += Assert(
        (column < size.columns) & (row < size.rows), "SRAM_A is inside of the picture"
    )


# Idle is reset.


def _idle(m: Module, d: SimpleNamespace, further: Collection[str] = ()) -> None:
    properties.outputs_rest(m, d, d.EN, FPGA)
    properties.idle_is_reset(m, d, d.EN, {"search.x", "search.y", *further})


# ACK is high exactly when all rows are stored.

_WRITERS = writer_wires("pix_writer", "pix") | writer_wires("link_writer", "link")


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, d.EN)
    properties.acknowledges(m, d, d.ACK, pix_writer=d.PCLK, link_writer=d.LINK_C_I[0])


# No wire has two active drivers in any settled state.

_DRIVES_LINK = {Action.SEND_PICTURE, Action.SEND_EDGE}

_DRIVERS = {
    f"{side}_{port}": f"{side}.{port}"
    for side in SIDES
    for port in ("DATA_OE", "LINK_D_OE", "LINK_C_OE")
}


def _drivers(mcu_addressing: bool, m: Module, d: SimpleNamespace) -> None:
    pins.drivers(m, d)
    for levels, actions in table.settled_rows(mcu_addressing=mcu_addressing):
        for side, action in actions._asdict().items():
            data = getattr(d, f"{side}_DATA_OE") == (action in pins.PRESENTS)
            link = getattr(d, f"{side}_LINK_D_OE") == (action in _DRIVES_LINK)
            text = f"at levels {levels} the {side} FPGA drives what its action {action} needs"
            m.d.comb += Assert(~pins.at_levels(d, levels) | (data & link), text)
    if mcu_addressing:
        microcontroller_may = (~d.SHIFT & ~d.RNW) | (d.SUNEN & d.NADEN)
        text = "DATA is free while the microcontroller may drive it"
        m.d.comb += Assert(~microcontroller_may | ~d.DATA_OE, text)


# The address that the microcontroller sends is the one that is read.

_TAKEN = wires_below("dataflow", "addressing", "take_address", "read_from")


def _takes_addresses(m: Module, d: SimpleNamespace) -> None:
    """Three clocks set the address, whatever it was; SHIFT alone never changes it."""
    starts_in(m, d.EN)
    sync = properties.domain(m, "monitor", d.CLK, ~d.addressing)
    taken = Signal(8 * ADDRESS_BYTES)
    count = Signal(range(ADDRESS_BYTES + 1))  # bytes since the last read or reset, at most all
    with m.If(d.take_address):
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
        Assert(~d.addressing | same, "SRAM_A is the address that the microcontroller sent"),
        Assert(d.addressing == (d.take_address | d.read_from), AUXILIARY),
        Assert(~d.take_address | (d.SRAM_CE_N & ~d.DATA_OE), "no byte is read while it is sent"),
        Assert(count <= ADDRESS_BYTES, AUXILIARY),
    ]


def _proofs(side: Side) -> dict[str, Proof]:
    return {
        f"{side}-address": Proof(
            "The SRAM address never leaves the picture",
            fpga(side),
            _address_stays_inside,
            StuckWire("reader.window.clamped_x", 7),
            _POSITIONS,
        ),
        **{
            f"{side}-ack{'-addressing' * mcu_addressing}": Proof(
                properties.ACKNOWLEDGES,
                fpga(side, mcu_addressing),
                _acknowledges,
                StuckWire("pix_writer.counter.last_row", 1),
                _WRITERS,
            )
            for mcu_addressing in (False, True)
        },
        **{
            f"{side}-idle{'-addressing' * mcu_addressing}": Proof(
                "With EN high every register but the Sun's coordinates is reset, and they rest",
                fpga(side, mcu_addressing),
                _idle,
                StuckWire("pix_writer.pix_rst" if side == "sun" else "link_writer.link_rst", 0),
            )
            for mcu_addressing in (False, True)
        },
        **edge_proofs(side),
        **edge_proofs(side, mcu_addressing=True),
        f"{side}-taken-address": Proof(
            "What is read first is at the address that the microcontroller gave",
            fpga(side, mcu_addressing=True),
            _takes_addresses,
            StuckWire("dataflow.take_address", 1),
            _TAKEN,
        ),
    }


def pair(mcu_addressing: bool = False, gateware: str = "corrected") -> DesignMaker:
    return proof_design(partial(CubeSensePair, mcu_addressing=mcu_addressing), gateware)


#: Bugs of the storing FPGA that break each of its strides.
STRIDE_FAULTS = {
    "row": StuckWire("pix_writer.counter.last_column", 1),
    "pause": StuckWire("pix_gap.long", 1),
    "row-before": StuckWire("pix_writer.accept", 1),
    "pause-before": StuckWire("pix_gap.long", 1),
}

PROOFS = {
    **{
        f"pair-strides-{gateware}{'-addressing' * mcu_addressing}": stride_proof(
            pair(mcu_addressing, gateware), StuckWire("sun.pix_gap.long", 1)
        )
        for gateware in table.READ_OUTS
        for mcu_addressing in (False, True)
    },
    **{
        f"pair-drivers{'-addressing' * mcu_addressing}": Proof(
            "No wire of the two FPGAs has two drivers in any settled state",
            proof_design(partial(CubeSensePair, mcu_addressing=mcu_addressing)),
            partial(_drivers, mcu_addressing),
            StuckWire("nadir.dataflow.pass_edge", 1),
            _DRIVERS,
        )
        for mcu_addressing in (False, True)
    },
    "pair-drivers-one-search": Proof(
        "No wire of the two FPGAs has two drivers in any settled state",
        proof_design(CubeSensePair, "one-search"),
        partial(_drivers, False),
        StuckWire("nadir.dataflow.pass_edge", 1),
        _DRIVERS,
    ),
    **as_printed_proofs(),
    "sun-idle-as-printed": Proof(
        "With EN high every register but the Sun's coordinates and the window's address is reset",
        fpga("sun", gateware="both-searches"),
        partial(_idle, further=("reader.window.shown",)),
        StuckWire("pix_writer.pix_rst", 0),
    ),
    **_proofs("sun"),
    **_proofs("nadir"),
}
