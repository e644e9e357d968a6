"""Both of CubeSense's FPGAs, their link and their shared microcontroller bus.

CubeSense thesis, figure 3.9 and tables 3.3 and 3.4. The wires between the two chips are resolved
here, so that simulators need no tri-state lines.
"""

from amaranth.hdl import Cat, Module, Value

from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.pins import resized
from cubestack.hdl.blocks.pinned import PinnedComponent, Stride, connect_ports
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.cubesense.strides import strides_of
from cubestack.hdl.cubesense.top import CubeSenseFpga

#: Ports that each FPGA has separately; in the pair their names have the prefix SUN_ or NAD_.
OWN_PORTS = [port.name for pin in pins.OWN_PINS for port in pin.ports]


class CubeSensePair(PinnedComponent):
    """The two FPGAs with all of their pins except those of the link.

    SUNEN and NADEN are active low; RNW, CLK, EDGE and SHIFT go to both FPGAs. DATA is the
    microcontroller's bus; it is 0 while no FPGA drives it, that is while DATA_OE is low. On the
    link, an undriven data line is 0 and an undriven control line 1. With ``mcu_addressing`` DATA_I
    is what the microcontroller drives on its bus; it must drive nothing while DATA_OE is high.

    CONTENTION is not 0 when both FPGAs drive the same wire: bit 0 DATA, bit 1 the link's data,
    bits 2 and 3 its control lines. The SRAMs' data buses are not included.

    In a linked store one FPGA's clock is an output of the other one. A cycle-based simulator such
    as CXXRTL must evaluate twice before it commits, or it misses that clock's edges.
    """

    def __init__(self, read_out: ReadOut = FULL_SIZE, mcu_addressing: bool = False) -> None:
        self.read_out = read_out
        self.mcu_addressing = mcu_addressing
        width = read_out.address_bits
        super().__init__(
            resized(pins.pair_pins(mcu_addressing), SUN_SRAM_A=width, NAD_SRAM_A=width)
        )

    @property
    def strides(self) -> tuple[Stride, ...]:
        return tuple(one for side in SIDES for one in strides_of(side, self.read_out))

    def _fpga(self, side: Side) -> PinnedComponent:
        return CubeSenseFpga(side, self.read_out, self.mcu_addressing)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.sun = sun = self._fpga("sun")
        m.submodules.nadir = nadir = self._fpga("nadir")
        common = [*pins.COMMON_PINS, *(pins.DATA_I,) * self.mcu_addressing]
        for prefix, fpga in zip(pins.PREFIXES.values(), (sun, nadir), strict=True):
            own = [(name, prefix + name) for name in OWN_PORTS]
            connect_ports(m, fpga, self, own + [(name, name) for name in common])

        link_data = driven_level(sun.LINK_D_O, sun.LINK_D_OE, nadir.LINK_D_O, nadir.LINK_D_OE)
        link_control = pulled_up_level(sun.LINK_C_O, sun.LINK_C_OE, nadir.LINK_C_O, nadir.LINK_C_OE)
        enables = ("DATA_OE", "LINK_D_OE", "LINK_C_OE")
        both_drive = Cat(getattr(sun, name) & getattr(nadir, name) for name in enables)
        m.d.comb += [
            sun.EN.eq(self.SUNEN),
            nadir.EN.eq(self.NADEN),
            self.SUNACK.eq(sun.ACK),
            self.NADACK.eq(nadir.ACK),
            sun.LINK_D_I.eq(link_data),
            nadir.LINK_D_I.eq(link_data),
            sun.LINK_C_I.eq(link_control),
            nadir.LINK_C_I.eq(link_control),
            self.DATA.eq(driven_level(sun.DATA_O, sun.DATA_OE, nadir.DATA_O, nadir.DATA_OE)),
            self.DATA_OE.eq(sun.DATA_OE | nadir.DATA_OE),
            self.CONTENTION.eq(both_drive),
        ]
        return m


def driven_level(sun: Value, sun_oe: Value, nadir: Value, nadir_oe: Value) -> Value:
    """Level of eight data lines that at most one FPGA drives; 0 when neither does."""
    return (sun & sun_oe.replicate(8)) | (nadir & nadir_oe.replicate(8))


def pulled_up_level(sun: Value, sun_oe: Value, nadir: Value, nadir_oe: Value) -> Value:
    """Level of lines with a pull-up, which either FPGA may pull low."""
    return (sun | ~sun_oe) & (nadir | ~nadir_oe)
