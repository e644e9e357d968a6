"""Formal properties of CubeStar's boards on the processor's bus, for the next version."""

from functools import partial
from types import SimpleNamespace

from amaranth.hdl import Assert, Module

from cubestack.firmware_model.interface.cubestar.pins import DOUBLE, SHARED
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.proofs import properties
from cubestack.hdl.proofs.cubestar import published
from cubestack.hdl.proofs.cubestar.published import inside
from cubestack.hdl.proofs.properties import AUXILIARY, starts_in, writer_wires, written_is_driven
from cubestack.hdl.proofs.prover import Proof, StuckWire
from cubestack.hdl.proofs.strides import stride_proof

_SHARED, _DOUBLE, _BOARDS = map(published.full, (CubeStarShared, CubeStarDouble, CubeStarTwoBoards))


_INSIDE = "while storing {} is inside of the picture"
_BUS_READ = "AD_LOW is driven only while the selected board is read"


def _shared_address(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    m.d.comb += [
        Assert(inside(d.written, d.size), AUXILIARY),
        Assert((d.ENABLE & d.RNW) | inside(d.SRAM_A[:-1], d.size), _INSIDE.format("SRAM_A")),
    ]


def _double_address(m: Module, d: SimpleNamespace) -> None:
    """The processor may address anything in the other memory."""
    starts_in(m, ~d.ENABLE)
    storing = d.ENABLE & ~d.RNW
    m.d.comb += [
        Assert(inside(d.written, d.size), AUXILIARY),
        Assert(~(storing & ~d.into) | inside(d.SRAM1_A, d.size), _INSIDE.format("SRAM1_A")),
        Assert(~(storing & d.into) | inside(d.SRAM2_A, d.size), _INSIDE.format("SRAM2_A")),
    ]


def _boards_acknowledge(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.BOARD1_ENABLE & ~d.BOARD2_ENABLE)
    properties.acknowledges(m, d, d.BOARD1_ACK, board1=d.PIXCLK)
    properties.acknowledges(m, d, d.BOARD2_ACK, board2=d.PIXCLK)


def _boards_idle(m: Module, d: SimpleNamespace) -> None:
    """Each board by itself, whatever the other one does."""
    for board, standby in (("board1", ~d.BOARD1_ENABLE), ("board2", ~d.BOARD2_ENABLE)):
        own = [register for register in d.registers if register.name.startswith(f"{board}.")]
        properties.idle_is_reset(m, SimpleNamespace(registers=own), standby, {f"{board}.bank"})


def _double_idle(m: Module, d: SimpleNamespace) -> None:
    """RNW latches INTO in standby too; no output shows it there."""
    properties.outputs_rest(m, d, ~d.ENABLE, DOUBLE)
    for register in d.registers:
        if register.reset is not None:
            text = f"in standby register {register.name} has its reset value"
            m.d.comb += Assert(d.ENABLE | (register.value == register.reset), text)


def _shared_drivers(m: Module, d: SimpleNamespace) -> None:
    written_is_driven(m, d)
    m.d.comb += [
        # The processor releases the data lines before it pulls RE_N low.
        Assert(~d.AD_LOW_OE | (~d.RE_N & ~d.CS_N), _BUS_READ),
        Assert(~d.AD_LOW_OE | (d.ENABLE & d.RNW), "AD_LOW is driven only with ENABLE and RNW high"),
    ]


def _double_drivers(m: Module, d: SimpleNamespace) -> None:
    written_is_driven(m, d, "SRAM1")
    written_is_driven(m, d, "SRAM2")
    m.d.comb += Assert(~d.AD_LOW_OE | (~d.RE_N & ~d.CS_N & d.ENABLE), _BUS_READ)


def _apart(m: Module, d: SimpleNamespace) -> None:
    """While one memory is being filled, its pins follow the camera and the other's the bus."""
    storing = d.ENABLE & ~d.RNW
    a, d_o, d_oe, ce_n, oe_n, we_n = (
        (getattr(d, f"SRAM1_{name}"), getattr(d, f"SRAM2_{name}"))
        for name in ("A", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")
    )
    for into in (0, 1):
        here = storing & (d.into == into)
        other = 1 - into
        reached = ~d.CS_N & (d.address[-1] == other)
        m.d.comb += [
            Assert(~here | ((a[into] == d.writer_address) & (d_oe[into] == d.writer_store))),
            Assert(~here | ((we_n[into] == ~(d.writer_store & ~d.PIXCLK)) & ~ce_n[into])),
            Assert(~here | (oe_n[into] & (d_o[into] == d.writer_data) | ~d.writer_store)),
            Assert(~here | (we_n[other] == ~(reached & ~d.WE_N & d.RE_N))),
            Assert(~here | (oe_n[other] == ~(reached & ~d.RE_N))),
            Assert(~here | ~reached | (a[other] == d.address[:-1])),
        ]


def _one_board_drives(m: Module, d: SimpleNamespace) -> None:
    text = "with one board selected no other drives the bus"
    m.d.comb += Assert(~d.CONTENTION | (~d.BOARD1_CS_N & ~d.BOARD2_CS_N), text)


_STORES_INSIDE = "Storing never leaves the picture, at 1000 x 500 pixels, where it could"

PROOFS = {
    "cubestar-shared-ack": Proof(
        properties.ACKNOWLEDGES,
        _SHARED,
        published.ack_is_right,
        published.LAST_ROW,
        published.WRITER,
    ),
    "cubestar-shared-address": Proof(
        _STORES_INSIDE,
        published.gapped(CubeStarShared),
        _shared_address,
        published.LAST_COLUMN,
        {"written": "writer.address"},
    ),
    "cubestar-shared-drivers": Proof(
        "FPGA, SRAM and processor never drive the same data lines",
        _SHARED,
        _shared_drivers,
        StuckWire("bus.writing", 1),
    ),
    "cubestar-shared-idle": Proof(
        published.BANK_RESTS, _SHARED, partial(published.bank_rests, SHARED), StuckWire("bus.on", 1)
    ),
    "cubestar-shared-row": stride_proof(_SHARED, published.ROW_ENDS, "row"),
    "cubestar-double-ack": Proof(
        properties.ACKNOWLEDGES,
        _DOUBLE,
        published.ack_is_right,
        published.LAST_ROW,
        published.WRITER,
    ),
    "cubestar-double-address": Proof(
        _STORES_INSIDE,
        published.gapped(CubeStarDouble),
        _double_address,
        published.LAST_COLUMN,
        {"written": "writer.address", "into": "into"},
    ),
    "cubestar-double-apart": Proof(
        "The memory that is stored in is the camera's alone, the other one the bus's",
        _DOUBLE,
        _apart,
        StuckWire("reached2", 1),
        {
            **{"into": "into", "address": "bus.address"},
            **{f"writer_{name}": f"writer.{name}" for name in ("address", "store", "data")},
        },
    ),
    "cubestar-double-drivers": Proof(
        "FPGA, SRAMs and processor never drive the same data lines",
        _DOUBLE,
        _double_drivers,
        StuckWire("write1", 1),
    ),
    "cubestar-double-idle": Proof(
        "With ENABLE low every register but the latched INTO is reset",
        _DOUBLE,
        _double_idle,
        StuckWire("bus.on", 1),
    ),
    "cubestar-double-row-1": stride_proof(_DOUBLE, published.ROW_ENDS, "row-1"),
    "cubestar-double-row-2": stride_proof(_DOUBLE, published.ROW_ENDS, "row-2"),
    "cubestar-boards-ack": Proof(
        properties.ACKNOWLEDGES,
        _BOARDS,
        _boards_acknowledge,
        StuckWire("board2.writer.counter.last_row", 1),
        writer_wires("board1", "pix", "board1.writer")
        | writer_wires("board2", "pix", "board2.writer"),
    ),
    "cubestar-boards-idle": Proof(
        "With its ENABLE low every register of a board but the bank is reset, and the bank rests",
        _BOARDS,
        _boards_idle,
        StuckWire("board2.writer.pix_rst", 0),
    ),
    "cubestar-boards-drivers": Proof(
        "Two boards drive the bus together only when both are selected",
        _BOARDS,
        _one_board_drives,
        StuckWire("board2.bus.reading", 1),
    ),
}
