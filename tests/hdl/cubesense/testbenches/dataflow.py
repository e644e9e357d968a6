"""Dataflow control of one side against the command table, at all levels of its inputs."""

import os
from itertools import product
from typing import Any

import cocotb
from cocotb.triggers import Timer
from cocotb.types import LogicArray

from cubestack.firmware_model.interface.cubesense.fpga import Action, actions, link_shows_enables
from tests.hdl.cubesense.reference import MCU_ADDRESSING

SIDE = os.environ["SIDE"]
ADDRESSING = {Action.TAKE_ADDRESS, Action.READ_FROM}
ACTIONS = {*Action} - {Action.STANDBY} - (set() if MCU_ADDRESSING else ADDRESSING)
OUTPUTS = {"edge_data" if a is Action.EDGE else a.name.lower(): a for a in ACTIONS}


def taken(dut: Any) -> list[Action]:
    return [action for name, action in OUTPUTS.items() if int(getattr(dut, name).value)]


@cocotb.test()
async def every_row_and_every_unlisted_row(dut: Any) -> None:
    done = set()
    for shift, edge, rnw, own, other in product((0, 1), repeat=5):
        dut.shift.value, dut.edge.value, dut.rnw.value = shift, edge, rnw
        dut.en_n.value, dut.other_en_n.value = own, other
        await Timer(1, unit="ns")
        other = other if link_shows_enables(shift, edge) else 0
        sunen, naden = (own, other) if SIDE == "sun" else (other, own)
        listed = actions(shift, edge, rnw, sunen, naden, mcu_addressing=MCU_ADDRESSING)
        expected = getattr(listed, SIDE)
        assert taken(dut) == ([] if expected is Action.STANDBY else [expected])
        done.add(expected)
        if MCU_ADDRESSING:
            assert int(dut.addressing.value) == (expected in ADDRESSING)
    assert done == {Action.STANDBY, *OUTPUTS.values()}


@cocotb.test()
async def other_enable_is_no_input_where_it_makes_no_difference(dut: Any) -> None:
    """Else its change could disturb a picture that is being stored; unknown stands for a change."""
    dut.other_en_n.value = LogicArray("X")
    dut.en_n.value = 0
    for shift, edge, rnw in ((0, 0, 0), (1, 0, 0), (1, 0, 1)):
        dut.shift.value, dut.edge.value, dut.rnw.value = shift, edge, rnw
        await Timer(1, unit="ns")
        assert taken(dut) == [getattr(actions(shift, edge, rnw, 0, 0), SIDE)]
