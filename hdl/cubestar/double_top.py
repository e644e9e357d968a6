"""CubeStar's FPGA board with two SRAMs: one is filled while the processor reads the other.

CubeStar thesis, option 3 of section 3.3. It was rejected because the AGLN030 has only 77 pins; this
design needs 95. Pins and protocol are assumed.

How each asynchronous input is brought in:

- The camera's pins, ENABLE and RNW as in :mod:`cubestack.hdl.cubestar.top`.
- INTO is latched by the falling edge of RNW and must be stable around it.
- The bus is combinational; ALE clocks the address latch. ENABLE changes only between two accesses,
  and so does RNW for accesses to the memory that is being filled.
"""

from amaranth.hdl import ClockDomain, ClockSignal, Module, Signal

from cubestack.firmware_model.interface.cubestar.pins import DOUBLE
from cubestack.hdl.blocks.pinned import Stride
from cubestack.hdl.cubestar.board import CubeStarBoard

_SRAM = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")


class CubeStarDouble(CubeStarBoard):
    """Frame buffer and bus switch for two memories of one image each.

    ENABLE = 0: standby, every output at its reset value. ENABLE = 1: the bus is connected to the
    memories, at addresses memory : row : column. ENABLE = 1, RNW = 0: the next whole frame is
    stored in memory INTO, which is disconnected from the bus meanwhile, then ACK rises; it stays
    high until RNW rises. Reading a disconnected memory drives nothing. If one memory has failed,
    the other one is filled and read alternately.
    """

    _pins = DOUBLE
    _banks = False

    @property
    def strides(self) -> tuple[Stride, ...]:
        return tuple(
            self._row_stored(f"row-{number}", f"SRAM{number}", (("into", number - 1),))
            for number in (1, 2)
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.start = ClockDomain(clk_edge="neg", reset_less=True, local=True)
        storing = Signal()
        into = Signal()
        m.d.start += into.eq(self.INTO)
        m.d.comb += [storing.eq(self.ENABLE & ~self.RNW), ClockSignal("start").eq(self.RNW)]
        writer = self._add_writer(m, storing)
        bus = self._add_bus(m, self.ENABLE, len(self.SRAM1_A) + 1)
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
