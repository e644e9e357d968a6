"""What is proved of CubeStar's tops for the next version."""

from types import SimpleNamespace

from amaranth.hdl import Assert, Module, Value
from amaranth.lib.wiring import Component

from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.two_boards import CubeStarTwoBoards
from cubestack.hdl.proofs.cubestar.published import gapped, inside
from cubestack.hdl.proofs.properties import (
    acknowledges_all_rows,
    idle_is_reset,
    starts_in,
    writer_wires,
)
from cubestack.hdl.proofs.prover import Fault, Proof

__all__ = ["PROOFS"]


def _size(small: bool) -> SimpleNamespace:
    columns, rows = (3, 3) if small else (1024, 512)
    return SimpleNamespace(columns=columns, rows=rows)


def _shared(small: bool) -> tuple[Component, SimpleNamespace]:
    size = _size(small)
    return CubeStarShared(size.columns, size.rows), size


def _double(small: bool) -> tuple[Component, SimpleNamespace]:
    size = _size(small)
    return CubeStarDouble(size.columns, size.rows), size


def _boards(small: bool) -> tuple[Component, SimpleNamespace]:
    size = _size(small)
    return CubeStarTwoBoards(size.columns, size.rows), size


def _gapped_shared(small: bool) -> tuple[Component, SimpleNamespace]:
    size = gapped(small)
    return CubeStarShared(size.columns, size.rows), size


def _gapped_double(small: bool) -> tuple[Component, SimpleNamespace]:
    size = gapped(small)
    return CubeStarDouble(size.columns, size.rows), size


def _shared_address(m: Module, d: SimpleNamespace) -> None:
    """The processor may address anything."""
    starts_in(m, ~d.ENABLE)
    m.d.comb += [
        Assert(inside(d.written, d.size)),
        Assert((d.ENABLE & d.RNW) | inside(d.SRAM_A[:-1], d.size)),
    ]


def _double_address(m: Module, d: SimpleNamespace) -> None:
    """The processor may address anything in the other memory."""
    starts_in(m, ~d.ENABLE)
    storing = d.ENABLE & ~d.RNW
    m.d.comb += [
        Assert(inside(d.written, d.size)),
        Assert(~(storing & ~d.into) | inside(d.SRAM1_A, d.size)),
        Assert(~(storing & d.into) | inside(d.SRAM2_A, d.size)),
    ]


def _acknowledges(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    size = d.size.columns, d.size.rows
    m.d.comb += Assert(acknowledges_all_rows(m, d, "writer", d.PIXCLK, *size) == d.ACK)


def _boards_acknowledge(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.BOARD1_ENABLE & ~d.BOARD2_ENABLE)
    size = d.size.columns, d.size.rows
    for board, ack in (("board1", d.BOARD1_ACK), ("board2", d.BOARD2_ACK)):
        m.d.comb += Assert(acknowledges_all_rows(m, d, board, d.PIXCLK, *size) == ack)


def _boards_idle(m: Module, d: SimpleNamespace) -> None:
    """Each board by itself, whatever the other one does."""
    for board, standby in (("board1", ~d.BOARD1_ENABLE), ("board2", ~d.BOARD2_ENABLE)):
        own = [register for register in d.registers if register.name.startswith(f"{board}.")]
        idle_is_reset(m, SimpleNamespace(registers=own), standby, {f"{board}.bank"})


def _standby(m: Module, d: SimpleNamespace, srams: tuple[str, ...]) -> Value:
    """Every output but the SRAMs' addresses is at its reset value; the standby they are in."""
    standby = ~d.ENABLE
    for level in (d.ACK, d.AD_LOW_O, d.AD_LOW_OE):
        m.d.comb += Assert(~standby | (level == 0))
    for sram in srams:
        for name in ("D_O", "D_OE"):
            m.d.comb += Assert(~standby | (getattr(d, f"{sram}_{name}") == 0))
        for name in ("CE_N", "OE_N", "WE_N"):
            m.d.comb += Assert(~standby | getattr(d, f"{sram}_{name}"))
    return standby


def _shared_idle(m: Module, d: SimpleNamespace) -> None:
    standby = _standby(m, d, ("SRAM",))
    m.d.comb += Assert(~standby | (d.SRAM_A[:-1] == 0))
    idle_is_reset(m, d, standby, {"bank"})


def _double_idle(m: Module, d: SimpleNamespace) -> None:
    """INTO is latched by RNW in standby too, as its docstring says; nothing shows it there."""
    standby = _standby(m, d, ("SRAM1", "SRAM2"))
    m.d.comb += Assert(~standby | ((d.SRAM1_A == 0) & (d.SRAM2_A == 0)))
    for register in d.registers:
        if register.reset is not None:
            m.d.comb += Assert(~standby | (register.value == register.reset))


def _drivers(m: Module, d: SimpleNamespace, sram: str) -> None:
    """SRAM and FPGA on the SRAM's bus; what is written is driven and selected."""

    def pin(name: str) -> Value:
        return getattr(d, f"{sram}_{name}")

    m.d.comb += [
        Assert(~pin("D_OE") | pin("OE_N")),
        Assert(pin("WE_N") | (pin("D_OE") & ~pin("CE_N"))),
    ]


def _shared_drivers(m: Module, d: SimpleNamespace) -> None:
    _drivers(m, d, "SRAM")
    m.d.comb += [
        # The processor lets go of the data lines before it pulls RE_N low.
        Assert(~d.AD_LOW_OE | (~d.RE_N & ~d.CS_N)),
        Assert(~d.AD_LOW_OE | (d.ENABLE & d.RNW)),
    ]


def _double_drivers(m: Module, d: SimpleNamespace) -> None:
    _drivers(m, d, "SRAM1")
    _drivers(m, d, "SRAM2")
    m.d.comb += Assert(~d.AD_LOW_OE | (~d.RE_N & ~d.CS_N & d.ENABLE))


def _apart(m: Module, d: SimpleNamespace) -> None:
    """While a memory is stored in, its pins are the camera's and the other's are the bus's."""
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
    m.d.comb += Assert(~d.CONTENTION | (~d.BOARD1_CS_N & ~d.BOARD2_CS_N))


_ACK = "ACK is high exactly from when all rows of a frame are stored"
_LAST_ROW = Fault("writer.counter.last_row", 1)

#: By name.
PROOFS = {
    "cubestar-shared-ack": Proof(
        _ACK, _shared, writer_wires("writer", "pix"), _acknowledges, _LAST_ROW
    ),
    "cubestar-shared-address": Proof(
        "Storing never leaves the picture, at 1000 x 500 pixels, where it could",
        _gapped_shared,
        {"written": "writer.address"},
        _shared_address,
        Fault("writer.counter.last_column", 0),
    ),
    "cubestar-shared-drivers": Proof(
        "FPGA, SRAM and processor never drive the same data lines",
        _shared,
        {},
        _shared_drivers,
        Fault("bus.writing", 1),
    ),
    "cubestar-shared-idle": Proof(
        "With ENABLE low every register but the bank is reset, and the bank rests",
        _shared,
        {},
        _shared_idle,
        Fault("bus.on", 1),
    ),
    "cubestar-double-ack": Proof(
        _ACK, _double, writer_wires("writer", "pix"), _acknowledges, _LAST_ROW
    ),
    "cubestar-double-address": Proof(
        "Storing never leaves the picture, at 1000 x 500 pixels, where it could",
        _gapped_double,
        {"written": "writer.address", "into": "into"},
        _double_address,
        Fault("writer.counter.last_column", 0),
    ),
    "cubestar-double-apart": Proof(
        "The memory that is stored in is the camera's alone, the other one the bus's",
        _double,
        {
            "into": "into",
            "address": "bus.address",
            "writer_address": "writer.address",
            "writer_store": "writer.store",
            "writer_data": "writer.data",
        },
        _apart,
        Fault("reached2", 1),
    ),
    "cubestar-double-drivers": Proof(
        "FPGA, SRAMs and processor never drive the same data lines",
        _double,
        {},
        _double_drivers,
        Fault("write1", 1),
    ),
    "cubestar-double-idle": Proof(
        "With ENABLE low every register but the latched INTO is reset",
        _double,
        {},
        _double_idle,
        Fault("bus.on", 1),
    ),
    "cubestar-boards-ack": Proof(
        _ACK,
        _boards,
        writer_wires("board1", "pix", "board1.writer")
        | writer_wires("board2", "pix", "board2.writer"),
        _boards_acknowledge,
        Fault("board2.writer.counter.last_row", 1),
    ),
    "cubestar-boards-idle": Proof(
        "With its ENABLE low every register of a board but the bank is reset, and the bank rests",
        _boards,
        {},
        _boards_idle,
        Fault("board2.writer.pix_rst", 0),
    ),
    "cubestar-boards-drivers": Proof(
        "Two boards drive the bus together only when both are selected",
        _boards,
        {},
        _one_board_drives,
        Fault("board2.bus.reading", 1),
    ),
}
