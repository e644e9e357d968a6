"""The position counter against division and remainder."""

import random
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY


async def clock(dut: Any, **pins: int) -> tuple[int, int, int]:
    for name in ("next_column", "next_row", "clear", "rst"):
        getattr(dut, name).value = pins.get(name, 0)
    dut.clk.value = 0
    await Timer(random.randint(1, 50), unit="ns")
    dut.clk.value = 1
    await Timer(random.randint(1, 50), unit="ns")
    return int(dut.address.value), int(dut.last_column.value), int(dut.last_row.value)


def outputs(position: int) -> tuple[int, int, int]:
    row, column = divmod(position, GEOMETRY.columns)
    return (GEOMETRY.address(column, row), column == GEOMETRY.columns - 1, row == GEOMETRY.rows - 1)


@cocotb.test()
async def walks_every_position_and_starts_again(dut: Any) -> None:
    assert await clock(dut, rst=1) == outputs(0)
    for step in range(1, 2 * GEOMETRY.pixels + 2):
        assert await clock(dut, next_column=1) == outputs(step % GEOMETRY.pixels)


@cocotb.test()
async def obeys_the_strongest_command(dut: Any) -> None:
    await clock(dut, rst=1)
    position = 0
    visited = set()
    for _ in range(60 * GEOMETRY.pixels):
        pins = {
            "next_column": random.random() < 0.8,
            "next_row": random.random() < 0.1,
            "clear": random.random() < 0.2 / GEOMETRY.pixels,
        }
        if pins["clear"]:
            position = 0
        elif pins["next_row"]:
            position = (position // GEOMETRY.columns + 1) * GEOMETRY.columns % GEOMETRY.pixels
        elif pins["next_column"]:
            position = (position + 1) % GEOMETRY.pixels
        assert await clock(dut, **pins) == outputs(position)
        visited.add(position)
    assert len(visited) == GEOMETRY.pixels
