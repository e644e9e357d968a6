"""Both of CubeSense's FPGAs on one I2C bus, and their link.

CubeSense thesis, section 9.2.1 and figure 9.1. What is wired between the two chips is resolved
here, so that simulators need no tri-state lines.
"""

from amaranth.hdl import Cat, Module

from cubesense_fpga_i2c.pins import PAIR
from cubesense_fpga_i2c.top import CubeSenseI2cFpga
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.firmware_model.interface.pins import resized
from cubestack.hdl.blocks.pinned import PinnedComponent, connect_ports
from cubestack.hdl.cubesense.pair import OWN_PORTS, driven_level, pulled_up_level


class CubeSenseI2cPair(PinnedComponent):
    """The two FPGAs with all of their pins but those of the link.

    SCL and RESET_N go to both. SDA_I is what all others make of the bus' data line, SDA what it is
    with the two FPGAs, which pull it low together while they acknowledge their group's address. A
    data line of the link that nobody drives is 0, and a control line 1.

    CONTENTION is not 0 when both FPGAs drive the link: bit 0 its data, bit 1 its control lines.
    """

    def __init__(self, read_out: ReadOut = FULL_SIZE) -> None:
        """Make the pair."""
        self.read_out = read_out
        width = read_out.address_bits
        super().__init__(resized(PAIR, SUN_SRAM_A=width, NAD_SRAM_A=width))

    def elaborate(self, platform: object) -> Module:
        """Join the two FPGAs."""
        m = Module()
        m.submodules.sun = sun = CubeSenseI2cFpga("sun", self.read_out)
        m.submodules.nadir = nadir = CubeSenseI2cFpga("nadir", self.read_out)
        link_data = driven_level(sun.LINK_D_O, sun.LINK_D_OE, nadir.LINK_D_O, nadir.LINK_D_OE)
        link_control = pulled_up_level(
            sun.LINK_C_O, sun.LINK_C_OE.replicate(2), nadir.LINK_C_O, nadir.LINK_C_OE.replicate(2)
        )
        for prefix, fpga in zip(PREFIXES.values(), (sun, nadir), strict=True):
            own = [(name, prefix + name) for name in OWN_PORTS]
            connect_ports(m, fpga, self, [*own, ("SCL", "SCL"), ("RESET_N", "RESET_N")])
            m.d.comb += [
                fpga.SDA_I.eq(self.SDA),
                fpga.LINK_D_I.eq(link_data),
                fpga.LINK_C_I.eq(link_control),
            ]
        sda = pulled_up_level(sun.SDA_O, sun.SDA_OE, nadir.SDA_O, nadir.SDA_OE)
        m.d.comb += [
            self.SDA.eq(self.SDA_I & sda),
            self.CONTENTION.eq(
                Cat(sun.LINK_D_OE & nadir.LINK_D_OE, sun.LINK_C_OE & nadir.LINK_C_OE)
            ),
        ]
        return m
