"""CubeSense's blocks, each alone, and the pair on its pins, on Icarus Verilog; the pins' table."""

import gc
import random
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.cubesense.pins import ADDRESSING, FPGA
from cubestack.hdl.blocks.counters import GrayCounter
from cubestack.hdl.blocks.frames import FrameGap
from cubestack.hdl.blocks.pinned import connect_ports
from cubestack.hdl.cubesense.dataflow import DataflowControl
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.sun_window import SunWindow
from cubestack.hdl.cubesense.top import CubeSenseFpga
from cubestack.hdl.flow.generate import rtlil_text
from tests.hdl.regression import FULL, SMALLEST, addressable
from tests.tiers import quick, quick_ones

NAMES = ["modes", "read", "store", "failures"]
SEEDS = (1, 2) if FULL else (1,)


@pytest.mark.parametrize("seed", SEEDS)
def test_cubesense_pair_passes_its_testbenches(simulate: Any, read_out: ReadOut, seed: int) -> None:
    simulate(CubeSensePair, read_out, *NAMES, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_cubesense_pair_needs_no_initial_values(simulate: Any, seed: int) -> None:
    """Standby alone sets the state: the parts' flip-flops power up at any level."""
    names = NAMES.copy()
    random.Random(seed).shuffle(names)
    simulate(CubeSensePair, SMALLEST, *names, seed=seed, initialised=False)


@pytest.mark.parametrize("seed", SEEDS)
def test_addressing_testbench_passes(simulate: Any, read_out: ReadOut, seed: int) -> None:
    simulate(addressable, read_out, "addressing", mcu_addressing=True, seed=seed)


@pytest.mark.slow
def test_addressing_testbench_passes_at_full_size(simulate: Any) -> None:
    simulate(addressable, FULL_SIZE, "addressing", mcu_addressing=True, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("initialised", quick([False, True], 1))
def test_other_testbenches_pass_with_the_addressing_option(
    simulate: Any, initialised: bool
) -> None:
    options = {"mcu_addressing": True, "initialised": initialised}
    simulate(addressable, SMALLEST, *NAMES, seed=1, **options)


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


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("block", quick_ones(BLOCKS, "sun_search"))
def test_cubesense_block_passes_its_testbench(
    simulate: Any, read_out: ReadOut, block: str, seed: int
) -> None:
    simulate(BLOCKS[block], read_out, block, name=block, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("addressing", [False, True], ids=["published", "addressing"])
@pytest.mark.parametrize("side", ["sun", "nadir"])
def test_dataflow_block_passes_its_testbench(simulate: Any, side: Any, addressing: bool) -> None:
    options = {"mcu_addressing": addressing, "side": side, "seed": 1}
    options["name"] = f"{side}_dataflow_{addressing}"
    make = partial(DataflowControl, side, mcu_addressing=addressing)
    simulate(lambda _: make(), ReadOut(), "dataflow", **options)


@pytest.mark.parametrize("side", quick(["sun", "nadir"], 1))
def test_single_fpga_passes_its_testbench(simulate: Any, read_out: ReadOut, side: Any) -> None:
    options = {"name": f"{side}_fpga", "side": side, "seed": 1}
    simulate(partial(CubeSenseFpga, side), read_out, "fpga_alone", **options)


TABLES = FPGA, ADDRESSING


def test_cubesense_fpgas_have_the_64_published_pins() -> None:
    assert sum(pin.width for pin in FPGA) == 64
    for fpga in (CubeSenseFpga("sun"), CubeSenseFpga("nadir", mcu_addressing=True)):
        rtlil_text(fpga)  # a design must be used, Amaranth says
        assert [(pin, pin.width) for pin in fpga.pins] == [(pin, pin.width) for pin in FPGA]
        assert {port.name for pin in fpga.pins for port in pin.ports} == set(fpga.signature.members)


def test_addressing_option_uses_no_additional_pin() -> None:
    published, addressed = ({port for pin in pins for port in pin.ports} for pins in TABLES)
    assert {port.name for port in addressed - published} == {"DATA_I"}
    assert published < addressed


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
def test_cubesense_fpga_rejects_an_unknown_side() -> None:
    with pytest.raises(ValueError, match='must be "sun" or "nadir", not \'moon\''):
        CubeSenseFpga("moon")  # type: ignore[arg-type]
    gc.collect(1)  # what was refused is never elaborated; have Amaranth say so here


def test_pair_has_every_pin_but_the_links() -> None:
    pair = CubeSensePair()
    rtlil_text(pair)
    members = set(pair.signature.members)
    assert {"SUNEN", "NADEN", "RNW", "CLK", "EDGE", "SHIFT", "SUNACK", "NADACK"} < members
    assert not [name for name in members if "LINK" in name]
    sun, nadir = ({n[4:] for n in members if n.startswith(half)} for half in ("SUN_", "NAD_"))
    assert sun == nadir
