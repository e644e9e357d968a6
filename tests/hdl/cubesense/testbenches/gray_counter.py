"""The Gray-code counter against its formula."""

import random
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.timing import clock
from tests.hdl.cubesense.reference import READ_OUT

POSITIONS = READ_OUT.pixels


def code(position: int) -> int:
    return position ^ (position >> 1)


async def step(dut: Any, position: int, **pins: int) -> None:
    await clock(dut, "pix", **{"step": 0, "clear": 0, **pins})
    assert int(dut.address.value) == code(position)
    assert int(dut.last.value) == (position == POSITIONS - 1)


@cocotb.test()
async def one_line_changes_at_a_step(dut: Any) -> None:
    await step(dut, 0, reset=1)
    for position in range(1, POSITIONS):
        before = int(dut.address.value)
        await step(dut, position, step=1)
        assert (before ^ int(dut.address.value)).bit_count() == 1


@cocotb.test()
async def starts_again_clears_and_rests(dut: Any) -> None:
    await step(dut, 0, reset=1)
    position = 0
    for _ in range(3 * POSITIONS):
        pins = {"step": random.random() < 0.9, "clear": random.random() < 0.3 / POSITIONS}
        position = 0 if pins["clear"] else (position + pins["step"]) % POSITIONS
        await step(dut, position, **pins)
