"""Both of CubeSense's FPGAs on one I2C bus, and their link.

CubeSense thesis, section 9.2.1 and figure 9.1. What is wired between the two chips is resolved
here, so that simulators need no tri-state lines.
"""

from amaranth.hdl import Cat, Module, Signal, Value
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.i2c.top import CubeSenseI2cFpga

__all__ = ["CubeSenseI2cPair"]

#: Ports that each FPGA has for itself; in the pair SUN_ or NAD_ goes before their names.
_OWN = (
    "Y",
    "HREF",
    "PCLK",
    "SRAM_A",
    "SRAM_D_I",
    "SRAM_D_O",
    "SRAM_D_OE",
    "SRAM_CE_N",
    "SRAM_OE_N",
    "SRAM_WE_N",
)


class CubeSenseI2cPair(Component):
    """The two FPGAs with all of their pins but those of the link.

    SCL and RESET_N go to both. SDA_I is what all others make of the bus' data line, SDA what it is
    with the two FPGAs, which pull it low together while they acknowledge their group's address. A
    data line of the link that nobody drives is 0, and a control line 1.

    CONTENTION is not 0 when both FPGAs drive the link: bit 0 its data, bit 1 its control lines.
    """

    def __init__(self, read_out: ReadOut = FULL_SIZE) -> None:
        """Make the pair."""
        self.read_out = read_out
        self._sun = CubeSenseI2cFpga("sun", read_out)
        self._nadir = CubeSenseI2cFpga("nadir", read_out)
        members = self._sun.signature.members
        super().__init__(
            {
                **{f"SUN_{name}": members[name] for name in _OWN},
                **{f"NAD_{name}": members[name] for name in _OWN},
                "SCL": members["SCL"],
                "SDA_I": members["SDA_I"],
                "SDA": Out(1, init=1),
                "RESET_N": members["RESET_N"],
                "CONTENTION": Out(2),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Join the two FPGAs."""
        m = Module()
        m.submodules.sun = sun = self._sun
        m.submodules.nadir = nadir = self._nadir
        link_data = Signal(8)
        link_control = Signal(2)
        for prefix, fpga in (("SUN_", sun), ("NAD_", nadir)):
            for name in _OWN:
                inside, outside = getattr(fpga, name), getattr(self, prefix + name)
                into = fpga.signature.members[name].flow is In
                m.d.comb += inside.eq(outside) if into else outside.eq(inside)
            m.d.comb += [
                fpga.SCL.eq(self.SCL),
                fpga.SDA_I.eq(self.SDA),
                fpga.RESET_N.eq(self.RESET_N),
                fpga.LINK_D_I.eq(link_data),
                fpga.LINK_C_I.eq(link_control),
            ]
        m.d.comb += [
            self.SDA.eq(self.SDA_I & _released(sun.SDA_O, sun.SDA_OE, nadir.SDA_O, nadir.SDA_OE)),
            link_data.eq(
                (sun.LINK_D_O & sun.LINK_D_OE.replicate(8))
                | (nadir.LINK_D_O & nadir.LINK_D_OE.replicate(8))
            ),
            link_control.eq(
                _released(
                    sun.LINK_C_O,
                    sun.LINK_C_OE.replicate(2),
                    nadir.LINK_C_O,
                    nadir.LINK_C_OE.replicate(2),
                )
            ),
            self.CONTENTION.eq(
                Cat(sun.LINK_D_OE & nadir.LINK_D_OE, sun.LINK_C_OE & nadir.LINK_C_OE)
            ),
        ]
        return m


def _released(sun: Value, sun_oe: Value, nadir: Value, nadir_oe: Value) -> Value:
    """Level of lines that are pulled up, which a driver of either FPGA may hold low."""
    return (sun | ~sun_oe) & (nadir | ~nadir_oe)
