"""CubeSense's blocks, each alone, on Icarus Verilog."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.blocks.counters import GrayCounter
from cubestack.hdl.blocks.frames import FrameGap
from cubestack.hdl.blocks.pinned import connect_ports
from cubestack.hdl.cubesense.dataflow import DataflowControl
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.sun_window import SunWindow
from cubestack.hdl.cubesense.top import CubeSenseFpga
from tests.tiers import quick


class AsynchronousReset(Component):
    """A block whose domain, ``pix``, is reset without a clock, as it is in the FPGA."""

    def __init__(self, block: Component) -> None:
        self._block = block
        super().__init__({**block.signature.members, "pix_clk": In(1), "pix_rst": In(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.block = self._block
        m.domains.pix = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal("pix").eq(self.pix_clk), ResetSignal("pix").eq(self.pix_rst)]
        connect_ports(m, self._block, self, ((n, n) for n in self._block.signature.members))
        return m


BLOCKS: dict[str, Callable[[ReadOut], Component]] = {
    "frame_gap": lambda size: FrameGap(size.frame_gap, domain="pix"),
    "nadir_scan": NadirScan,
    "sun_search": lambda size: AsynchronousReset(SunSearch(size)),
    "sun_window": SunWindow,
    "gray_counter": lambda size: GrayCounter(size.pixels, domain="pix"),
}


@pytest.mark.parametrize("seed", quick([1, 2], 1))
@pytest.mark.parametrize("block", BLOCKS)
def test_block(simulate: Any, read_out: ReadOut, block: str, seed: int) -> None:
    simulate(BLOCKS[block], read_out, block, name=block, seed=seed)


@pytest.mark.parametrize("addressing", [False, True], ids=["published", "addressing"])
@pytest.mark.parametrize("side", ["sun", "nadir"])
def test_dataflow(simulate: Any, side: Any, addressing: bool) -> None:
    options = {"mcu_addressing": addressing, "side": side, "seed": 1}
    options["name"] = f"{side}_dataflow_{addressing}"
    make = partial(DataflowControl, side, mcu_addressing=addressing)
    simulate(lambda _: make(), ReadOut(), "dataflow", **options)


@pytest.mark.parametrize("side", ["sun", "nadir"])
def test_fpga_alone(simulate: Any, read_out: ReadOut, side: Any) -> None:
    options = {"name": f"{side}_fpga", "side": side, "seed": 1}
    simulate(partial(CubeSenseFpga, side), read_out, "fpga_alone", **options)
