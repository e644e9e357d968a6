"""Evaluations taken apart by clock: what is left out, and when nothing may be."""

import re

import pytest

from cubestack.emulator.boards.cubestar.wiring import (
    cubestar_double_wiring,
    cubestar_two_boards_wiring,
    cubestar_wiring,
)
from cubestack.emulator.rtl.cxxrtl.clock_steps import clock_steps
from cubestack.emulator.rtl.cxxrtl.variants import input_names, members, variant_text
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubestar.pins import BOARD_PREFIXES, RNW
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import rtlil_text


def variant(wiring: Wiring) -> str:
    return variant_text(rtlil_text(wiring.component), wiring.burst_levels[0])


@pytest.fixture(scope="module")
def star() -> tuple[Wiring, str]:
    wiring = cubestar_wiring(CubeStarTop(5, 3))
    return wiring, variant(wiring)


def steps(wiring: Wiring, text: str) -> str:
    return clock_steps(wiring, text, dict(members(text)), 0)


def test_the_release_of_the_reset_is_waited_for(star):
    text = steps(*star)
    assert "in_reset(std::integral_constant<int, 0>) const { return p_pix__reset" in text
    assert len(re.findall(r"^changed \|= ", text, re.MULTILINE)) == 11


def test_a_falling_clock_moves_the_write_strobe_alone(star):
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


def test_memories_are_followed_where_they_can_move():
    wiring = cubestar_double_wiring(CubeStarDouble(5, 3))
    # INTO is held, not known: either memory may be the one.
    assert "return 3u >> memory & 1;" in steps(wiring, variant(wiring))


def test_the_memory_of_the_board_that_does_not_store_stays_as_it_is():
    wiring = cubestar_two_boards_wiring(CubeStarTwoBoards(5, 3))
    text = rtlil_text(wiring.component)
    for levels in wiring.burst_levels[::2]:
        (own,) = [n for n, p in enumerate(BOARD_PREFIXES) if {*levels} >= {(p + RNW, 0)}]
        made = steps(wiring, variant_text(text, levels))
        assert f"return {1 << own}u >> memory & 1;" in made, levels


def test_registers_that_nothing_clocks_are_inputs():
    wiring = cubestar_double_wiring(CubeStarDouble(32, 16))
    text = variant(wiring)
    assert {"p_into", "p_bus_2e_latched"} < {*input_names(text)}
    assert not {"p_into", "p_bus_2e_latched"} & {n for n, k in members(text).items() if "wire" in k}
