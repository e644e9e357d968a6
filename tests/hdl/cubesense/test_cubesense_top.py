"""The FPGA's pins are those of table 3.4."""

import gc
from collections.abc import Callable

import pytest
from amaranth.hdl import Shape
from amaranth.lib.wiring import Component

from cubestack.hdl.blocks.frame_gap import FrameGap
from cubestack.hdl.blocks.gray_counter import GrayCounter
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.top import ADDRESSING_PINS, PINS, CubeSenseFpga
from cubestack.hdl.flow.generate import rtlil_text


def test_published_pins() -> None:
    top = CubeSenseFpga("sun")
    rtlil_text(top)  # a design must be used, Amaranth says
    members = top.signature.members
    assert sum(pins.number for pins in PINS) == 64
    assert sorted(port for pins in PINS for port in pins.ports) == sorted(members)
    for pins in PINS:
        assert max(Shape.cast(members[port].shape).width for port in pins.ports) == pins.number


def test_address_control_takes_no_further_pin() -> None:
    published, top = CubeSenseFpga("nadir"), CubeSenseFpga("nadir", mcu_addressing=True)
    for design in (published, top):
        rtlil_text(design)
    assert set(top.signature.members) - set(published.signature.members) == {"DATA_I"}
    (data,) = [pins for pins in PINS if "DATA_O" in pins.ports]
    assert set(ADDRESSING_PINS.ports) == {*data.ports, "DATA_I"}
    assert ADDRESSING_PINS.number == data.number


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: CubeSenseFpga("moon"), 'must be "sun" or "nadir", not \'moon\''),
        (lambda: FrameGap(0), "clocks must be at least 1, not 0"),
        (lambda: GrayCounter(3), "positions must be at least 4, not 3"),
    ],
)
def test_impossible_designs_are_refused(make: Callable[[], Component], error: str) -> None:
    with pytest.raises(ValueError, match=error):
        make()
    gc.collect()  # what was refused is never elaborated; have Amaranth say so here


def test_pair_has_every_pin_but_the_links() -> None:
    pair = CubeSensePair()
    rtlil_text(pair)
    members = set(pair.signature.members)
    assert {"SUNEN", "NADEN", "RNW", "CLK", "EDGE", "SHIFT", "SUNACK", "NADACK"} < members
    assert not [name for name in members if "LINK" in name]
    assert {n[4:] for n in members if n.startswith("SUN_")} == {
        n[4:] for n in members if n.startswith("NAD_")
    }
