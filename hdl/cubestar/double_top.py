"""CubeStar's FPGA board with two SRAMs in turn: one is filled while the processor has the other.

CubeStar thesis, option 3 of section 3.3. It was not taken up because the AGLN030 has too few pins,
77: this design has 95. Pins and protocol are ours, and keep those of the published board (table
C.2) wherever they still serve.

How each asynchronous input is brought in:

- The camera's pins, ENABLE and RNW as in :mod:`cubestack.hdl.cubestar.top`.
- INTO is latched by the falling edge of RNW and must be stable around it.
- The bus passes through without a clock; ALE clocks the address latch. ENABLE changes between two
  accesses only, and so does RNW for accesses to the memory that is stored in.
"""

from amaranth.hdl import ClockDomain, ClockSignal, Module, Signal
from amaranth.lib.cdc import ResetSynchronizer
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.frame_writer import FrameWriter
from cubestack.hdl.blocks.matrix_counter import MatrixCounter
from cubestack.hdl.cubestar import shared_top as cubestar_shared_top

__all__ = ["PINS", "CubeStarDouble"]

#: Meaning of each port but the SRAMs'.
PINS = {name: text for name, text in cubestar_shared_top.PINS.items() if name != "BANK"} | {
    "RNW": "low: a picture is stored",
    "INTO": "memory to store in, latched by the falling RNW",
}

_SRAM = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")


class CubeStarDouble(Component):
    """Frame buffer and bus switch for two memories of one picture each.

    ENABLE = 0: standby, every output at its reset value. ENABLE = 1: the bus has the memories, at
    addresses memory : row : column. RNW = 0 besides: the next whole frame is stored in memory INTO,
    which the bus does not reach meanwhile, then ACK rises; it stays until RNW rises. Reading a
    memory that is out of reach drives nothing. With one memory failed the other one serves both in
    turn.
    """

    def __init__(self, columns: int = 1024, rows: int = 512) -> None:
        """Make the top for frames of ``columns`` x ``rows`` pixels."""
        self.columns = columns
        self.rows = rows
        sram = {
            "A": Out(MatrixCounter.address_width(columns, rows)),
            "D_I": In(8),
            "D_O": Out(8),
            "D_OE": Out(1),
            "CE_N": Out(1, init=1),
            "OE_N": Out(1, init=1),
            "WE_N": Out(1, init=1),
        }
        super().__init__(
            {
                "PIXCLK": In(1),
                "PIXDATA": In(8),
                "HSYNC": In(1),
                "VSYNC": In(1),
                "ENABLE": In(1),
                "RNW": In(1),
                "INTO": In(1),
                "ACK": Out(1),
                "AD_HIGH": In(8),
                "AD_LOW_I": In(8),
                "AD_LOW_O": Out(8),
                "AD_LOW_OE": Out(1),
                "ALE": In(1),
                "CS_N": In(1, init=1),
                "RE_N": In(1, init=1),
                "WE_N": In(1, init=1),
                **{f"SRAM{n}_{name}": member for n in (1, 2) for name, member in sram.items()},
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Wire writer and bus to either SRAM."""
        m = Module()
        m.domains.pix = ClockDomain(async_reset=True, local=True)
        m.domains.start = ClockDomain(clk_edge="neg", reset_less=True, local=True)
        storing = Signal()
        m.d.comb += [
            storing.eq(self.ENABLE & ~self.RNW),
            ClockSignal("pix").eq(self.PIXCLK),
            ClockSignal("start").eq(self.RNW),
        ]
        m.submodules.pix_reset = ResetSynchronizer(~storing, domain="pix")
        m.submodules.writer = writer = FrameWriter(self.columns, self.rows, domain="pix")
        m.submodules.bus = bus = BusPort(len(self.SRAM1_A) + 1)
        into = Signal()
        m.d.start += into.eq(self.INTO)
        m.d.comb += [
            writer.pixel.eq(self.PIXDATA),
            writer.hsync.eq(self.HSYNC),
            writer.vsync.eq(self.VSYNC),
            self.ACK.eq(writer.ack),
            bus.on.eq(self.ENABLE),
            bus.high.eq(self.AD_HIGH),
            bus.low.eq(self.AD_LOW_I),
            bus.ale.eq(self.ALE),
            bus.cs_n.eq(self.CS_N),
            bus.re_n.eq(self.RE_N),
            bus.we_n.eq(self.WE_N),
        ]
        offered = []
        for number, stored_in, addressed in (
            (1, ~into, ~bus.address[-1]),
            (2, into, bus.address[-1]),
        ):
            a, d_i, d_o, d_oe, ce_n, oe_n, we_n = (
                getattr(self, f"SRAM{number}_{name}") for name in _SRAM
            )
            camera, reached = Signal(name=f"camera{number}"), Signal(name=f"reached{number}")
            store, read, write = (Signal(name=f"{n}{number}") for n in ("store", "read", "write"))
            m.d.comb += [
                camera.eq(storing & stored_in),
                reached.eq(~camera & addressed),
                store.eq(writer.store & stored_in),
                read.eq(bus.reading & reached),
                write.eq(bus.writing & reached),
                a.eq(
                    (writer.address & camera.replicate(len(a)))
                    | (bus.address[:-1] & reached.replicate(len(a)))
                ),
                d_o.eq((writer.data & store.replicate(8)) | (bus.data & write.replicate(8))),
                d_oe.eq(store | write),
                ce_n.eq(~(camera | (bus.selected & reached))),
                oe_n.eq(~read),
                we_n.eq(~((store & ~self.PIXCLK) | write)),
            ]
            offered.append((d_i & read.replicate(8), read))
        m.d.comb += [
            self.AD_LOW_O.eq(offered[0][0] | offered[1][0]),
            self.AD_LOW_OE.eq(offered[0][1] | offered[1][1]),
        ]
        return m
