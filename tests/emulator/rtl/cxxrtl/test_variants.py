"""Copies of the design with fixed pins: what stays of them."""

import re

import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.rtl.cxxrtl.pins_header import pins_header
from cubestack.emulator.rtl.cxxrtl.variants import members, variant_text
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.flow.generate import cxxrtl_text, rtlil_text
from tests.tiers import quick

from ..pair_board import SIZES

WIRING = cubesense_wiring(CubeSensePair(SIZES[0]))
FIRST = WIRING.burst_levels[0]


@pytest.fixture(scope="module")
def rtlil() -> str:
    return rtlil_text(WIRING.component)


def registers(text: str) -> set[str]:
    return {name for name, kind in members(text).items() if kind.startswith("wire")}


def test_each_way_to_store_has_one():
    assert len(WIRING.burst_levels) == 5
    assert all(dict(levels)["CLK"] == dict(levels)["EDGE"] == 0 for levels in WIRING.burst_levels)


@pytest.mark.parametrize(
    "levels", quick(map(pytest.param, WIRING.burst_levels), 1), ids=lambda levels: str(dict(levels))
)
def test_the_writers_stay_and_their_state_that_no_output_shows(rtlil, levels):
    pins = dict(levels)
    side, domain = ("nadir" if pins["SUNEN"] else "sun"), "pix"
    if pins["SHIFT"]:
        side, domain = ("sun" if pins["RNW"] else "nadir"), "link"
    left = registers(variant_text(rtlil, levels))
    writers = {name for name in left if f"_{domain}__" in name}
    assert any(name.startswith(f"p_{side}_") and "counter" in name for name in writers)
    # The first Sun pixel is searched by whoever stores the sun camera's picture.
    if not (pins["RNW"] if pins["SHIFT"] else pins["SUNEN"]):
        assert {f"p_{side}_2e_search_2e_{name}" for name in ("x", "y", "searching")} < left
    assert not any("reader" in name for name in left)
    assert left < registers(cxxrtl_text(WIRING.component))


def test_without_fixed_levels_every_register_stays(rtlil):
    assert registers(variant_text(rtlil, ())) == registers(cxxrtl_text(WIRING.component))


def test_names_the_wrong_input(rtlil):
    with pytest.raises(ValueError, match="no one-bit input SUNENN"):
        variant_text(rtlil, [("SUNENN", 0)])
    with pytest.raises(ValueError, match="no one-bit input SUN_Y"):
        variant_text(rtlil, [("SUN_Y", 0)])


def test_the_header_has_the_link_clock_detected_and_the_state_copied(rtlil):
    design = cxxrtl_text(WIRING.component)
    header = pins_header(WIRING, design, [variant_text(rtlil, FIRST)])
    assert "#define VARIANTS VARIANT(0)\n" in header
    whole = re.search(r"derived_edge\(const cxxrtl_design::p_top &top\) \{.*\}", header)
    assert whole is not None
    assert whole[0].count("posedge") == 2
    assert "return false" in header.partition("variant_0::p_top &top")[2]
    assert re.search(r"to\.p_sun\w*search\w*_x\.curr = from\.p_sun\w*search\w*_x\.curr;", header)
