"""A writer in its own clock domain; each of CubeSense's FPGAs has two.

CubeSense thesis, section 6.4.2: one for the own camera's image, one for the image over the link.
"""

from amaranth.hdl import ClockDomain, ClockSignal, Module, Value
from amaranth.lib.cdc import ResetSynchronizer

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.blocks.frame_gap import FrameGap
from cubestack.hdl.blocks.frame_writer import FrameWriter


def add_writer(
    m: Module, domain: str, wanted: Value, clock: Value, href: Value, pixel: Value, size: ReadOut
) -> FrameWriter:
    """Add a writer in the new clock domain ``domain`` of ``clock``, in reset unless ``wanted``.

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
