"""Both of CubeSense's FPGAs, their link and their common microcontroller bus.

CubeSense thesis, figure 3.9 and tables 3.3 and 3.4. What is wired between the two chips is
resolved here, so that simulators need no tri-state lines.
"""

from amaranth.hdl import Cat, Module, Value
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.top import CubeSenseFpga

__all__ = ["CubeSensePair"]

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
#: Ports that carry the same of the microcontroller's lines on both.
_COMMON = ("RNW", "CLK", "EDGE", "SHIFT")


class CubeSensePair(Component):
    """The two FPGAs with all of their pins but those of the link.

    SUNEN and NADEN are low active; RNW, CLK, EDGE and SHIFT go to both FPGAs. DATA is the
    microcontroller's bus, 0 while nobody drives it, which DATA_OE tells. A data line of the link
    that nobody drives is 0, and a control line 1. With ``mcu_addressing`` DATA_I is what the
    microcontroller drives on its bus; it must drive nothing while DATA_OE is high.

    CONTENTION is not 0 when both FPGAs drive the same wire: bit 0 DATA, bit 1 the link's data,
    bits 2 and 3 its control lines. The SRAMs' data buses are not among these.

    In a linked store one FPGA's clock is an output of the other one. A simulator that works in
    cycles, as CXXRTL does, must evaluate twice before it commits, or it misses that clock's edges.
    """

    def __init__(self, read_out: ReadOut = FULL_SIZE, mcu_addressing: bool = False) -> None:
        """Make the pair."""
        self.read_out = read_out
        self._sun = CubeSenseFpga("sun", read_out, mcu_addressing)
        self._nadir = CubeSenseFpga("nadir", read_out, mcu_addressing)
        self._common = (*_COMMON, *("DATA_I",) * mcu_addressing)
        members = self._sun.signature.members
        super().__init__(
            {
                **{f"SUN_{name}": members[name] for name in _OWN},
                **{f"NAD_{name}": members[name] for name in _OWN},
                **{name: members[name] for name in self._common},
                "SUNEN": In(1, init=1),
                "NADEN": In(1, init=1),
                "SUNACK": Out(1),
                "NADACK": Out(1),
                "DATA": Out(8),
                "DATA_OE": Out(1),
                "CONTENTION": Out(4),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Join the two FPGAs."""
        m = Module()
        m.submodules.sun = sun = self._sun
        m.submodules.nadir = nadir = self._nadir
        for prefix, fpga in (("SUN_", sun), ("NAD_", nadir)):
            own = [(name, prefix + name) for name in _OWN]
            ports = own + [(name, name) for name in self._common]
            for name, port in ports:
                if fpga.signature.members[name].flow is In:
                    m.d.comb += getattr(fpga, name).eq(getattr(self, port))
                else:
                    m.d.comb += getattr(self, port).eq(getattr(fpga, name))

        link_data = self._data(sun.LINK_D_O, sun.LINK_D_OE, nadir.LINK_D_O, nadir.LINK_D_OE)
        link_control = (sun.LINK_C_O | ~sun.LINK_C_OE) & (nadir.LINK_C_O | ~nadir.LINK_C_OE)
        m.d.comb += [
            sun.EN.eq(self.SUNEN),
            nadir.EN.eq(self.NADEN),
            self.SUNACK.eq(sun.ACK),
            self.NADACK.eq(nadir.ACK),
            sun.LINK_D_I.eq(link_data),
            nadir.LINK_D_I.eq(link_data),
            sun.LINK_C_I.eq(link_control),
            nadir.LINK_C_I.eq(link_control),
            self.DATA.eq(self._data(sun.DATA_O, sun.DATA_OE, nadir.DATA_O, nadir.DATA_OE)),
            self.DATA_OE.eq(sun.DATA_OE | nadir.DATA_OE),
            self.CONTENTION.eq(
                Cat(
                    sun.DATA_OE & nadir.DATA_OE,
                    sun.LINK_D_OE & nadir.LINK_D_OE,
                    sun.LINK_C_OE & nadir.LINK_C_OE,
                )
            ),
        ]
        return m

    @staticmethod
    def _data(sun: Value, sun_oe: Value, nadir: Value, nadir_oe: Value) -> Value:
        """Level of eight data lines that at most one FPGA drives."""
        return (sun & sun_oe.replicate(8)) | (nadir & nadir_oe.replicate(8))
