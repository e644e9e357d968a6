"""The search alone, on streams of written pixels."""

import random
from collections.abc import Sequence
from itertools import product
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import clock
from tests.hdl.cubesense.reference import NOT_FOUND, READ_OUT

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows
BRIGHT, DARK = (200, 201, 255), (0, 199, 128)


def first_sun(picture: Sequence[Sequence[int]]) -> tuple[int, int]:
    """First of three pixels of at least 200 side by side, row by row."""
    places = ((x, y) for y, x in product(range(ROWS), range(COLUMNS - 2)))
    return next(((x, y) for x, y in places if min(picture[y][x : x + 3]) >= 200), NOT_FOUND)


def dark() -> list[list[int]]:
    return [[random.choice(DARK) for _ in range(COLUMNS)] for _ in range(ROWS)]


def with_runs(*runs: tuple[int, int, int]) -> list[list[int]]:
    picture = dark()
    for x, y, length in runs:
        for column in range(x, min(x + length, COLUMNS)):
            picture[y][column] = random.choice(BRIGHT)
    return picture


async def start(dut: Any, reset: bool = True) -> None:
    if reset:
        await clock(dut, "pix", reset=1, start=1, store=0)
        await clock(dut, "pix", start=1)
    await clock(dut, "pix", start=1, store=0)
    assert found(dut) == NOT_FOUND


def found(dut: Any) -> tuple[int, int]:
    return int(dut.x.value), int(dut.y.value)


async def write(dut: Any, picture: Sequence[Sequence[int]], pixels: int | None = None) -> None:
    for y, row in enumerate(picture):
        for x, value in enumerate(row):
            if pixels is not None and y * COLUMNS + x >= pixels:
                return
            position = GEOMETRY.address(x, y)
            await clock(dut, "pix", start=0, store=1, pixel=value, address=position)
        await clock(dut, "pix", start=0, store=0, pixel=255, address=random.randrange(position + 1))


async def finds(dut: Any, picture: list[list[int]], reset: bool = True) -> tuple[int, int]:
    await start(dut, reset)
    await write(dut, picture)
    assert found(dut) == first_sun(picture)
    return found(dut)


@cocotb.test()
async def everywhere(dut: Any) -> None:
    for x, y in product(range(COLUMNS - 2), {0, 1, ROWS // 2, ROWS - 1}):
        assert await finds(dut, with_runs((x, y, random.randint(3, 5)))) == (x, y)


@cocotb.test()
async def stuck_pixels_are_ignored(dut: Any) -> None:
    """One or two bright ones side by side, also just before the Sun and at a row's end."""
    assert await finds(dut, with_runs((4, 0, 2), (1, 1, 1), (2, 2, 3), (0, 3, 9))) == (2, 2)
    assert await finds(dut, with_runs((0, 1, 2), (3, 1, 2), (6, 1, 4))) == (6, 1)
    assert await finds(dut, with_runs((COLUMNS - 2, 0, 2), (0, 1, 1))) == NOT_FOUND
    assert await finds(dut, with_runs((COLUMNS - 1, 0, 1), (0, 1, 2))) == NOT_FOUND
    assert await finds(dut, with_runs((COLUMNS - 2, 1, 2), (0, 2, 3))) == (0, 2)


@cocotb.test()
async def at_the_third_pixel_and_no_other(dut: Any) -> None:
    await start(dut)
    picture = with_runs((5, 2, 3), (1, 4, 6))
    third = 2 * COLUMNS + 7
    await write(dut, picture, third)
    assert found(dut) == NOT_FOUND
    await write(dut, picture, third + 1)
    assert found(dut) == (5, 2)


@cocotb.test()
async def retained_in_reset(dut: Any) -> None:
    """Whatever the other inputs do."""
    await finds(dut, with_runs((4, 3, 3)))
    for _ in range(50):
        pins = {"start": random.getrandbits(1), "store": random.getrandbits(1), "pixel": 255}
        await clock(dut, "pix", reset=1, address=random.randrange(GEOMETRY.bank_size), **pins)
        assert found(dut) == (4, 3)


@cocotb.test()
async def new_frame_searches_again(dut: Any) -> None:
    """Without a reset between, after a frame with a Sun and after one without."""
    pictures = (with_runs((1, 1, 3)), with_runs((7, 2, 3)), dark(), with_runs((2, 4, 4)))
    for number, picture in enumerate(pictures):
        await finds(dut, picture, reset=number == 0)


@cocotb.test()
async def any_picture(dut: Any) -> None:
    answers = set()
    for _ in range(20):
        share = random.choice([0.05, 0.2, 0.5])
        picture = [
            [random.choice(BRIGHT if random.random() < share else DARK) for _ in range(COLUMNS)]
            for _ in range(ROWS)
        ]
        answers.add(await finds(dut, picture, random.random() < 0.5))
    assert len(answers) > 5
