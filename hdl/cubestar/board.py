"""Common parts of CubeStar's boards: size, camera, writer, and the processor's bus.

How the camera's pins are brought in: PIXDATA, HSYNC and VSYNC change with PIXCLK and are used only
in its domain. "Not storing" is that domain's reset: asserted asynchronously, released through two
flip-flops.
"""

from amaranth.hdl import ClockDomain, ClockSignal, Module, Value
from amaranth.lib.cdc import ResetSynchronizer

from cubestack.firmware_model.interface.cubestar import pins
from cubestack.firmware_model.interface.pins import Pin, resized
from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.frames import FrameWriter
from cubestack.hdl.blocks.pinned import PinnedComponent, Stride


class CubeStarBoard(PinnedComponent):
    """A board, or a model of two, that stores images of ``columns`` x ``rows`` pixels."""

    _pins: tuple[Pin, ...]
    _banks: bool  # each memory holds two images; the top address bit selects one

    def __init__(self, columns: int = 1024, rows: int = 512) -> None:
        self.columns = columns
        self.rows = rows
        width = MatrixCounter.address_width(columns, rows) + self._banks
        addresses = [pin for pin in self._pins if pin.endswith("_A")]
        super().__init__(resized(self._pins, **dict.fromkeys(addresses, width)))

    def _row_stored(
        self, name: str = "row", memory: str = "SRAM", into: tuple[tuple[str, int], ...] = ()
    ) -> Stride:
        """Stride of the pixels inside a row, from the first one's write to the last one's.

        ``into``: levels of the registers that select ``memory``.
        """
        over = ("line_full", "frame_full", "ack")
        begun = ("store", "line_open", "between_lines_seen")
        return Stride(
            name,
            clock=pins.PIXCLK,
            levels=((pins.ENABLE, 1), (pins.RNW, 0), (pins.HSYNC, 1), (pins.VSYNC, 1)),
            state=(
                *((f"pix_reset.stage{stage}", 0) for stage in (0, 1)),
                *((f"writer.{register}", 1) for register in begun),
                *((f"writer.{register}", 0) for register in over),
                *into,
            ),
            counter="writer.counter.column",
            last=self.columns - 1,
            data="writer.data",
            source=pins.PIXDATA,
            memory=memory,
            access="store",
        )

    def _add_writer(self, m: Module, storing: Value) -> FrameWriter:
        """Add the camera's writer in the domain "pix", in reset unless ``storing``."""
        m.domains.pix = ClockDomain(async_reset=True, local=True)
        m.submodules.pix_reset = ResetSynchronizer(~storing, domain="pix")
        m.submodules.writer = writer = FrameWriter(self.columns, self.rows, domain="pix")
        m.d.comb += [
            ClockSignal("pix").eq(self.PIXCLK),
            writer.pixel.eq(self.PIXDATA),
            writer.hsync.eq(self.HSYNC),
            writer.vsync.eq(self.VSYNC),
            self.ACK.eq(writer.ack),
        ]
        return writer

    def _add_bus(self, m: Module, on: Value, address_width: int) -> BusPort:
        m.submodules.bus = bus = BusPort(address_width)
        m.d.comb += [
            bus.on.eq(on),
            bus.high.eq(self.AD_HIGH),
            bus.low.eq(self.AD_LOW_I),
            bus.ale.eq(self.ALE),
            bus.cs_n.eq(self.CS_N),
            bus.re_n.eq(self.RE_N),
            bus.we_n.eq(self.WE_N),
        ]
        return bus
