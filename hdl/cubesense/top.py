"""One of CubeSense's two FPGAs: an AGLN030 between camera, SRAM, microcontroller and its twin.

CubeSense thesis, tables 3.4, 6.3 and 6.4, sections 6.4 to 6.6 and figure 6.5; section 9.2.2.

How each asynchronous input is brought in:

- Y and HREF change with PCLK and are used only in its domain; signals from the link, only in the
  domain of the link's clock. Each domain has its own writer, so no clock is ever switched, and a
  camera without a clock affects only its own image.
- The control lines come from the microcontroller. For both pixel clocks, "not storing" is the
  domain's reset: asserted asynchronously, released through two flip-flops. For the data clock, "not
  reading" is the reset without a synchroniser, because the same microcontroller drives the control
  lines and CLK one after the other. Image, scan and window have one such reset each, so each starts
  from its first byte however it was reached.
- DATA_I, where present, is used with CLK only: the microcontroller drives both.
- The other FPGA's enable comes over the link and is used like the own one.

The coordinates of the first Sun pixel are not reset: a pixel clock writes them while a Sun image is
stored, and they are stable whenever a data clock reads them.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Value
from amaranth.lib.cdc import ResetSynchronizer

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.cubesense.pins import ADDRESSING, FPGA
from cubestack.firmware_model.interface.pins import resized
from cubestack.hdl.blocks.frames import FrameGap, FrameWriter
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.cubesense.dataflow import DataflowControl, Side, check_side
from cubestack.hdl.cubesense.reader import CubeSenseReader
from cubestack.hdl.cubesense.sun_search import SunSearch


class CubeSenseFpga(PinnedComponent):
    """The sun sensor's or the nadir sensor's FPGA with the pins of table 3.4.

    Bidirectional pins are i / o / oe triples. LINK_C_OE has one bit for each of its two lines.
    With EN high every output is at its reset value, all drivers off, whatever the other pins do.

    ``mcu_addressing`` makes the microcontroller's data bus bidirectional and adds the rows in which
    it sets the address. No FPGA drives the bus while SHIFT and RNW are both low, so the
    microcontroller may drive it then.
    """

    def __init__(
        self, side: Side, read_out: ReadOut = FULL_SIZE, mcu_addressing: bool = False
    ) -> None:
        """Raise ValueError unless ``side`` is "sun" or "nadir"."""
        self.side = check_side(side)
        self.read_out = read_out
        self.mcu_addressing = mcu_addressing
        pins = ADDRESSING if mcu_addressing else FPGA
        super().__init__(resized(pins, SRAM_A=read_out.address_bits))

    def elaborate(self, platform: object) -> Module:
        m = Module()
        is_sun, one_search = self.side == "sun", self.read_out.one_search
        addressing = self.mcu_addressing
        m.submodules.dataflow = mode = DataflowControl(self.side, mcu_addressing=addressing)
        m.submodules.reader = reader = CubeSenseReader(self.read_out, mcu_addressing=addressing)
        # With one search the sun's FPGA also searches an image that it sends.
        writing = mode.store | mode.send_picture if one_search and is_sun else mode.store
        own_writer = add_writer(m, "pix", writing, self.PCLK, self.HREF, self.Y, self.read_out)
        link_clock, link_href = self.LINK_C_I[0], self.LINK_C_I[1]
        link_writer = add_writer(
            m, "link", mode.store_other, link_clock, link_href, self.LINK_D_I, self.read_out
        )
        # The search runs on the sun camera's image, whichever memory stores it.
        if is_sun or not one_search:
            sun_writer = own_writer if is_sun else link_writer
            search = SunSearch(self.read_out, domain="pix" if is_sun else "link")
            m.submodules.search = search
            m.d.comb += [
                # The gap after a complete image starts no new search.
                search.start.eq(~sun_writer.vsync & ~sun_writer.ack),
                search.store.eq(sun_writer.store),
                search.pixel.eq(sun_writer.data),
                search.address.eq(sun_writer.address),
                reader.sun_x.eq(search.x),
                reader.sun_y.eq(search.y),
            ]

        own_line, other_line = (0, 1) if is_sun else (1, 0)
        orders = (reader.window, reader.scan)
        own_edge, other_edge = orders if is_sun else orders[::-1]
        presenting = mode.read | mode.edge_data
        if addressing:
            presenting |= mode.read_from
            m.d.comb += [
                reader.addressing.eq(mode.addressing),
                reader.take_address.eq(mode.take_address),
                reader.read_from.eq(mode.read_from),
                reader.address_byte.eq(self.DATA_I),
            ]
        reading = presenting | mode.send_edge
        own_stores, own_ack = own_writer.store, own_writer.ack
        own_active = ~ResetSignal("pix")
        if one_search and is_sun:
            own_stores, own_ack = own_stores & mode.store, own_ack & mode.store
            own_active &= mode.store
        storing = own_active | ~ResetSignal("link")
        shows_enable = ~self.EN & (self.EDGE | ~self.SHIFT)
        m.d.comb += [
            mode.en_n.eq(self.EN),
            mode.other_en_n.eq(self.LINK_C_I[other_line]),
            mode.rnw.eq(self.RNW),
            mode.edge.eq(self.EDGE),
            mode.shift.eq(self.SHIFT),
            reader.clk.eq(self.CLK),
            reader.picture.eq(mode.read | (mode.send_edge if one_search else 0)),
            own_edge.eq(mode.edge_data),
            other_edge.eq(0 if one_search else mode.send_edge),
            reader.memory.eq(self.SRAM_D_I),
            self.ACK.eq(own_ack | link_writer.ack),
            self.DATA_O.eq(reader.data | (self.LINK_D_I & mode.pass_edge.replicate(8))),
            self.DATA_OE.eq(presenting | mode.pass_edge),
            self.LINK_D_O.eq(reader.data | (self.Y & mode.send_picture.replicate(8))),
            self.LINK_D_OE.eq(mode.send_picture | mode.send_edge),
            # An enabled FPGA pulls the line low, so one without power reads as disabled.
            self.LINK_C_O.eq(Cat(self.PCLK, self.HREF) & mode.send_picture.replicate(2)),
            self.LINK_C_OE[own_line].eq(mode.send_picture | shows_enable),
            self.LINK_C_OE[other_line].eq(mode.send_picture),
            # At most one of the three is out of reset, and in reset an address is 0.
            self.SRAM_A.eq(own_writer.address | link_writer.address | reader.address),
            self.SRAM_D_O.eq(own_writer.data | link_writer.data),
            self.SRAM_D_OE.eq(own_stores | link_writer.store),
            self.SRAM_CE_N.eq(~(reading | storing)),
            self.SRAM_OE_N.eq(~reading),
            # The pulse ends with the clock's rising edge itself, before the address that this
            # edge advances.
            self.SRAM_WE_N.eq(
                ~((own_stores & ~self.PCLK) | (link_writer.store & ~self.LINK_C_I[0]))
            ),
        ]
        return m


def add_writer(
    m: Module, domain: str, wanted: Value, clock: Value, href: Value, pixel: Value, size: ReadOut
) -> FrameWriter:
    """Add a writer in the new clock domain ``domain`` of ``clock``, in reset unless ``wanted``.

    Section 6.4.2: one for the own camera's image, one for the image over the link.

    The reset is asserted asynchronously and released through two flip-flops.
    """
    m.domains += ClockDomain(domain, async_reset=True, local=True)
    m.d.comb += ClockSignal(domain).eq(clock)
    m.submodules[f"{domain}_reset"] = ResetSynchronizer(~wanted, domain=domain)
    m.submodules[f"{domain}_gap"] = gap = FrameGap(size.frame_gap, domain=domain)
    m.submodules[f"{domain}_writer"] = writer = FrameWriter(size.columns, size.rows, domain=domain)
    m.d.comb += [
        gap.href.eq(href),
        writer.hsync.eq(href),
        writer.vsync.eq(gap.vsync),
        writer.pixel.eq(pixel),
    ]
    return writer
