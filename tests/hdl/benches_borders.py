"""The SRAM address never leaves the picture, also where nothing is stored or read."""

import random
from collections.abc import Iterable
from typing import Any

import cocotb
from bench import Bench, flat, frame, line, lines, picture, timed_test
from cocotb.triggers import ReadOnly
from geometry import GEOMETRY
from reference import Tick

COLUMNS, ROWS = GEOMETRY


async def stays_in_the_picture(address: Any) -> None:
    """Whenever a point in time has settled."""
    columns = 1 << (COLUMNS - 1).bit_length()
    while True:
        await address.value_change
        await ReadOnly()
        row, column = divmod(int(address.value) % GEOMETRY.bank_size, columns)
        assert column < COLUMNS, f"column {column} is addressed"
        assert row < ROWS, f"row {row} is addressed"


def rows_of(sizes: Iterable[int]) -> list[Tick]:
    """Lines of so many random pixels."""
    return flat(list(line(random.randbytes(size))) for size in sizes)


@timed_test
async def with_lines_of_any_length(dut: Any) -> None:
    bench = await Bench.start(dut)
    cocotb.start_soon(stays_in_the_picture(dut.SRAM_A))
    whole, short = [COLUMNS] * (ROWS - 1), [1] * (ROWS - 1)
    for rows in ([*whole, 1], [*short, COLUMNS - 1], [*whole, COLUMNS + 1], [*short, 3 * COLUMNS]):
        await bench.store(random.getrandbits(1))
        bench.camera.send([*frame(b""), *rows_of(rows), *rows_of([1, COLUMNS, 2 * COLUMNS])])
        bench.camera.send([*frame(picture()), *flat(lines(picture()))])
        await bench.camera.sent()
        await bench.mcu.standby()
    await bench.check()
