"""CubeStar's frame buffer with one pin more: PARITY, beside ACK.

The firmware can compare it with the bytes that it reads, and so find an error of the memory.
"""

from amaranth.hdl import Module, Signal

from cubestack.firmware_model.interface.cubestar.pins import PUBLISHED
from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.cubestar.top import CubeStarTop


class Parity(CubeStarTop):
    """PARITY is the parity of all bits of the stored image, valid while ACK is high."""

    _pins = (*PUBLISHED, Pin("PARITY", "output", "parity of the stored image"))
    strides = ()

    def elaborate(self, platform: object) -> Module:
        m = super().elaborate(platform)
        writer = m.submodules.writer
        parity = Signal()
        with m.If(writer.store):
            m.d.pix += parity.eq(parity ^ writer.data.xor())
        with m.Elif(~self.VSYNC & ~writer.ack):
            m.d.pix += parity.eq(0)
        m.d.comb += self.PARITY.eq(parity)
        return m
