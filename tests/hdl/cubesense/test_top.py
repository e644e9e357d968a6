"""The FPGA's pins are those of table 3.4."""

import gc

import pytest

from cubestack.firmware_model.interface.cubesense.pins import ADDRESSING, FPGA
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.top import CubeSenseFpga
from cubestack.hdl.flow.generate import rtlil_text

TABLES = FPGA, ADDRESSING


def test_published_pins() -> None:
    assert sum(pin.width for pin in FPGA) == 64
    for fpga in (CubeSenseFpga("sun"), CubeSenseFpga("nadir", mcu_addressing=True)):
        rtlil_text(fpga)  # a design must be used, Amaranth says
        assert [(pin, pin.width) for pin in fpga.pins] == [(pin, pin.width) for pin in FPGA]
        assert {port.name for pin in fpga.pins for port in pin.ports} == set(fpga.signature.members)


def test_address_control_takes_no_further_pin() -> None:
    published, addressed = ({port for pin in pins for port in pin.ports} for pins in TABLES)
    assert {port.name for port in addressed - published} == {"DATA_I"}
    assert published < addressed


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
def test_rejects_impossible_side() -> None:
    with pytest.raises(ValueError, match='must be "sun" or "nadir", not \'moon\''):
        CubeSenseFpga("moon")  # type: ignore[arg-type]
    gc.collect()  # what was refused is never elaborated; have Amaranth say so here


def test_pair_has_every_pin_but_the_links() -> None:
    pair = CubeSensePair()
    rtlil_text(pair)
    members = set(pair.signature.members)
    assert {"SUNEN", "NADEN", "RNW", "CLK", "EDGE", "SHIFT", "SUNACK", "NADACK"} < members
    assert not [name for name in members if "LINK" in name]
    sun, nadir = ({n[4:] for n in members if n.startswith(half)} for half in ("SUN_", "NAD_"))
    assert sun == nadir
