"""The window alone, around every pixel of the picture."""

import random
from itertools import product
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import clock
from tests.hdl.cubesense.reference import NOT_FOUND, READ_OUT

COLUMNS, ROWS, SIZE = READ_OUT.columns, READ_OUT.rows, READ_OUT.window
PLACES = list(product(range(NOT_FOUND[0] + 1), range(NOT_FOUND[1] + 1)))


def origin_by_hand(x: int, y: int) -> tuple[int, int]:
    """Of all places inside of the picture, the one nearest to the wanted one."""
    columns, rows = range(COLUMNS - SIZE + 1), range(ROWS - SIZE + 1)
    return (
        min(columns, key=lambda left: abs(left - (x - READ_OUT.window_left))),
        min(rows, key=lambda top: abs(top - (y - READ_OUT.window_above))),
    )


async def presents(dut: Any, x: int, y: int, clocks: int) -> None:
    await clock(dut, "window", reset=1, x=x, y=y)
    for pin, value in expected(x, y, clocks):
        assert int(dut.coordinate.value) == (pin == "byte")
        assert int(getattr(dut, pin).value) == value
        assert pin == "address" or int(dut.address.value) == 0
        await clock(dut, "window")


def expected(x: int, y: int, clocks: int) -> list[tuple[str, int]]:
    coordinates = x.to_bytes(2, "little") + y.to_bytes(2, "little")
    left, top = origin_by_hand(x, y)
    pixels = [
        ("address", GEOMETRY.address(left + column, top + row))
        for row, column in product(range(SIZE), repeat=2)
    ]
    return ([("byte", byte) for byte in coordinates] + 3 * pixels)[:clocks]


@cocotb.test()
async def origin_is_declared(dut: Any) -> None:
    assert [READ_OUT.window_origin(x, y) for x, y in PLACES] == [origin_by_hand(*p) for p in PLACES]


@cocotb.test()
async def around_every_pixel(dut: Any) -> None:
    """And around places outside of the picture, such as "not found"."""
    whole = 4 + 2 * SIZE * SIZE + 3  # with the first pixel again
    await presents(dut, 5, 3, whole)
    for x, y in [*random.sample(PLACES, 40), *product((0, COLUMNS - 1), (0, ROWS - 1)), NOT_FOUND]:
        await presents(dut, x, y, 4 + SIZE + random.randrange(SIZE * SIZE))
