"""One of CubeSense's two FPGAs with an I2C bus in place of its pins to the microcontroller.

CubeSense thesis, section 9.2.1: two wires instead of eight control and eight data pins, the same
two for both FPGAs. The picture is read over them too, as the thesis has it, and the microcontroller
sets the address. The board is otherwise that of :mod:`cubestack.hdl.cubesense.top`.

How each asynchronous input is brought in:

- Y, HREF, and what comes over the link: as there, each with its clock.
- SCL and SDA clock the target. It needs no other clock, so it answers whatever the cameras do, also
  in standby; nothing but RESET_N resets it.
- COMMAND is the pixel clocks' reset: not storing asserts it without a clock, storing releases it
  through two flip-flops. It is the same register that was taken with one SCL edge by both FPGAs.
- ACK comes with a pixel clock and goes through two flip-flops of the falling SCL.
- The first Sun pixel comes with a pixel clock. It is masked while anything is stored.
- SRAM_D_I is sampled by the falling SCL a byte's time after the pointer has moved.
- RESET_N comes with the supply. It must rise while the bus is free.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, ResetSignal

from cubesense_fpga_i2c.pins import FPGA
from cubesense_fpga_i2c.registers import CubeSenseI2cRegisters
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.pins import resized
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.cubesense.dataflow import Side, check_side
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.top import add_writer


class CubeSenseI2cFpga(PinnedComponent):
    """The sun sensor's or the nadir sensor's FPGA.

    Bidirectional pins are i / o / oe triples; SDA_O is always 0. With RESET_N low, and in standby,
    every output but SDA is at its reset value, all drivers off. What COMMAND does is table 6.4's,
    without its edge rows.
    """

    def __init__(self, side: Side, read_out: ReadOut = FULL_SIZE) -> None:
        """Make one; ValueError when ``side`` is neither "sun" nor "nadir"."""
        self.side = check_side(side)
        self.read_out = read_out
        super().__init__(resized(FPGA, SRAM_A=read_out.address_bits))

    def elaborate(self, platform: object) -> Module:
        """Wire the blocks to the pins."""
        m = Module()
        size = self.read_out
        is_sun = self.side == "sun"
        m.domains.bus = ClockDomain(clk_edge="neg", async_reset=True, local=True)
        m.d.comb += [ClockSignal("bus").eq(self.SCL), ResetSignal("bus").eq(~self.RESET_N)]
        m.submodules.registers = registers = CubeSenseI2cRegisters(self.side, size)
        own_writer = add_writer(m, "pix", registers.store, self.PCLK, self.HREF, self.Y, size)
        link_clock, link_href = self.LINK_C_I[0], self.LINK_C_I[1]
        link_writer = add_writer(
            m, "link", registers.store_other, link_clock, link_href, self.LINK_D_I, size
        )
        # The Sun is looked for in the sun camera's picture, whichever memory it goes to.
        m.submodules.search = search = SunSearch(size, domain="pix" if is_sun else "link")
        sun_writer = own_writer if is_sun else link_writer

        sending = registers.send_picture
        storing = ~ResetSignal("pix") | ~ResetSignal("link")
        m.d.comb += [
            registers.scl.eq(self.SCL),
            registers.sda.eq(self.SDA_I),
            registers.ack.eq(own_writer.ack | link_writer.ack),
            registers.sun.eq(Cat(search.x, search.y)),
            registers.memory.eq(self.SRAM_D_I),
            self.SDA_OE.eq(registers.sda_low),
            # The gap after a complete picture starts no new search.
            search.start.eq(~sun_writer.vsync & ~sun_writer.ack),
            search.store.eq(sun_writer.store),
            search.pixel.eq(sun_writer.data),
            search.address.eq(sun_writer.address),
            self.LINK_D_O.eq(self.Y & sending.replicate(8)),
            self.LINK_D_OE.eq(sending),
            self.LINK_C_O.eq(Cat(self.PCLK, self.HREF) & sending.replicate(2)),
            self.LINK_C_OE.eq(sending),
            # At most one of the three is not 0.
            self.SRAM_A.eq(own_writer.address | link_writer.address | registers.address),
            self.SRAM_D_O.eq(own_writer.data | link_writer.data),
            self.SRAM_D_OE.eq(own_writer.store | link_writer.store),
            self.SRAM_CE_N.eq(~(registers.read | storing)),
            self.SRAM_OE_N.eq(~registers.read),
            # The pulse ends with the clock's rising edge itself, ahead of the address that the
            # same edge moves on.
            self.SRAM_WE_N.eq(
                ~((own_writer.store & ~self.PCLK) | (link_writer.store & ~link_clock))
            ),
        ]
        return m
