"""The window alone, around every pixel of the picture."""

import random
from typing import Any

import cocotb

from tests.hdl.cubesense.settings import READ_OUT, clock
from tests.hdl.harness.geometry import GEOMETRY

COLUMNS, ROWS, SIZE = READ_OUT.columns, READ_OUT.rows, READ_OUT.window
HIGHEST = (1 << (COLUMNS - 1).bit_length()) - 1, (1 << (ROWS - 1).bit_length()) - 1


def origin_by_hand(x: int, y: int) -> tuple[int, int]:
    """Of all places inside of the picture, the one nearest to the wanted one."""
    columns = [left for left in range(COLUMNS) if left + SIZE <= COLUMNS]
    rows = [top for top in range(ROWS) if top + SIZE <= ROWS]
    return (
        min(columns, key=lambda left: abs(left - (x - READ_OUT.window_left))),
        min(rows, key=lambda top: abs(top - (y - READ_OUT.window_above))),
    )


async def read(dut: Any, x: int, y: int, clocks: int) -> list[tuple[str, int]]:
    """What each of the first clocks is to present."""
    await clock(dut, "window", reset=1, x=x, y=y)
    offered = []
    for _ in range(clocks):
        if int(dut.coordinate.value):
            assert int(dut.address.value) == 0
            offered.append(("byte", int(dut.byte.value)))
        else:
            offered.append(("address", int(dut.address.value)))
        await clock(dut, "window")
    return offered


def expected(x: int, y: int, clocks: int) -> list[tuple[str, int]]:
    coordinates = x.to_bytes(2, "little") + y.to_bytes(2, "little")
    left, top = origin_by_hand(x, y)
    pixels = [
        ("address", GEOMETRY.address(left + column, top + row))
        for row in range(SIZE)
        for column in range(SIZE)
    ]
    return ([("byte", byte) for byte in coordinates] + 3 * pixels)[:clocks]


@cocotb.test()
async def origin_is_declared(dut: Any) -> None:
    for x in range(HIGHEST[0] + 1):
        for y in range(HIGHEST[1] + 1):
            assert READ_OUT.window_origin(x, y) == origin_by_hand(x, y)


@cocotb.test()
async def around_every_pixel(dut: Any) -> None:
    """And around places outside of the picture, such as "not found"."""
    places = [(x, y) for x in range(HIGHEST[0] + 1) for y in range(HIGHEST[1] + 1)]
    edges = [(x, y) for x, y in places if x in (0, COLUMNS - 1) and y in (0, ROWS - 1)]
    for x, y in [*random.sample(places, 40), *edges, HIGHEST]:
        clocks = 4 + SIZE + random.randrange(SIZE * SIZE)
        assert await read(dut, x, y, clocks) == expected(x, y, clocks)


@cocotb.test()
async def starts_again_after_the_last_pixel(dut: Any) -> None:
    clocks = 4 + 2 * SIZE * SIZE + 3
    assert await read(dut, 5, 3, clocks) == expected(5, 3, clocks)
