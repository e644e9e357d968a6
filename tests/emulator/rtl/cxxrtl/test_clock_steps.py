import re

import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import (
    cubestar_double_wiring,
    cubestar_two_boards_wiring,
    cubestar_wiring,
)
from cubestack.emulator.rtl.cxxrtl.clock_steps import clock_steps
from cubestack.emulator.rtl.cxxrtl.pins_header import pins_header
from cubestack.emulator.rtl.cxxrtl.variants import input_names, members, variant_text
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubestar.pins import BOARD_PREFIXES, RNW
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import cxxrtl_text, rtlil_text
from tests.tiers import quick

from ..pair_board import SIZES


def variant(wiring: Wiring) -> str:
    return variant_text(rtlil_text(wiring.component), wiring.burst_levels[0])


@pytest.fixture(scope="module")
def star() -> tuple[Wiring, str]:
    wiring = cubestar_wiring(CubeStarTop(5, 3))
    return wiring, variant(wiring)


def steps(wiring: Wiring, text: str) -> str:
    return clock_steps(wiring, text, dict(members(text)), 0)


@pytest.mark.slow
def test_compiled_step_handles_the_release_of_reset(star):
    text = steps(*star)
    assert "in_reset(std::integral_constant<int, 0>) const { return p_pix__reset" in text
    assert len(re.findall(r"^if \(Compare\) changed \|= ", text, re.MULTILINE)) == 11


def test_falling_clock_edge_changes_only_the_write_strobe(star):
    fall = steps(*star).partition("void fall(")[2]
    outputs = {name for name in members(star[1]) if name.startswith(("p_SRAM", "p_ACK", "p_DATA"))}
    own = {name for name in outputs if f"> {name};" not in fall and f"{name} = " in fall}
    assert own == {"p_SRAM__WE__N"}


@pytest.mark.parametrize(
    ("found", "instead"),
    [
        # A statement of another kind, a loop, a clock that the edge itself makes.
        ("\tp_ACK = ", "\tmystery();\n\tp_ACK = "),
        ("\tp_ACK = p_writer_2e_ack.curr", "\tp_ACK = p_ACK"),
        (
            "if (posedge_p_PIXCLK) {\n\t\tp_writer_2e_ack",
            "if (posedge_p_ACK) {\n\t\tp_writer_2e_ack",
        ),
    ],
)
def test_unknown_statements_fall_back_to_eval(star, found, instead):
    wiring, text = star
    assert found in text
    assert "return true; }" in steps(wiring, text.replace(found, instead))


@pytest.mark.slow
def test_compiled_burst_changes_only_the_memory_of_the_storing_board():
    wiring = cubestar_two_boards_wiring(CubeStarTwoBoards(5, 3))
    text = rtlil_text(wiring.component)
    for levels in wiring.burst_levels[::2]:
        (own,) = [n for n, p in enumerate(BOARD_PREFIXES) if {*levels} >= {(p + RNW, 0)}]
        made = steps(wiring, variant_text(text, levels))
        assert f"return {1 << own}u >> memory & 1;" in made, levels


@pytest.mark.slow
def test_unclocked_registers_become_inputs_of_the_compiled_step():
    wiring = cubestar_double_wiring(CubeStarDouble(32, 16))
    text = variant(wiring)
    # INTO is held, not known: either memory may be the one.
    assert "return 3u >> memory & 1;" in steps(wiring, text)
    assert {"p_into", "p_bus_2e_latched"} < {*input_names(text)}
    assert not {"p_into", "p_bus_2e_latched"} & {n for n, k in members(text).items() if "wire" in k}


WIRING = cubesense_wiring(CubeSensePair(SIZES[0]))
FIRST = WIRING.burst_levels[0]


@pytest.fixture(scope="module")
def rtlil() -> str:
    return rtlil_text(WIRING.component)


@pytest.fixture(scope="module")
def design() -> str:
    return cxxrtl_text(WIRING.component)


@pytest.fixture(scope="module")
def first(rtlil) -> str:
    return variant_text(rtlil, FIRST)


def registers(text: str) -> set[str]:
    return {name for name, kind in members(text).items() if kind.startswith("wire")}


def test_compiled_bursts_exist_for_each_store_state():
    assert len(WIRING.burst_levels) == 5
    assert all(dict(levels)["CLK"] == dict(levels)["EDGE"] == 0 for levels in WIRING.burst_levels)


@pytest.mark.parametrize(
    "levels", quick(map(pytest.param, WIRING.burst_levels), 1), ids=lambda levels: str(dict(levels))
)
def test_burst_variant_keeps_the_writers_and_their_hidden_state(rtlil, first, design, levels):
    pins = dict(levels)
    side, domain = ("nadir" if pins["SUNEN"] else "sun"), "pix"
    if pins["SHIFT"]:
        side, domain = ("sun" if pins["RNW"] else "nadir"), "link"
    left = registers(first if levels == FIRST else variant_text(rtlil, levels))
    writers = {name for name in left if f"_{domain}__" in name}
    assert any(name.startswith(f"p_{side}_") and "counter" in name for name in writers)
    # The first Sun pixel is searched by whoever stores the sun camera's picture.
    if not (pins["RNW"] if pins["SHIFT"] else pins["SUNEN"]):
        assert {f"p_{side}_2e_search_2e_{name}" for name in ("x", "y", "searching")} < left
    assert not any("reader" in name for name in left)
    assert left < registers(design)


def test_variant_without_fixed_levels_keeps_every_register(rtlil, design):
    assert registers(variant_text(rtlil, ())) == registers(design)


def test_unknown_variant_input_is_named_in_the_error(rtlil):
    with pytest.raises(ValueError, match="no one-bit input SUNENN"):
        variant_text(rtlil, [("SUNENN", 0)])
    with pytest.raises(ValueError, match="no one-bit input SUN_Y"):
        variant_text(rtlil, [("SUN_Y", 0)])


def test_pins_header_detects_the_link_clock_and_copies_state(first, design):
    header = pins_header(WIRING, design, [first])
    assert "#define VARIANTS VARIANT(0)\n" in header
    whole = re.search(r"derived_edge\(const cxxrtl_design::p_top &top\) \{.*\}", header)
    assert whole[0].count("posedge") == 2
    assert "return false" in header.partition("variant_0::p_top &top")[2]
    assert re.search(r"to\.p_sun\w*search\w*_x\.curr = from\.p_sun\w*search\w*_x\.curr;", header)
