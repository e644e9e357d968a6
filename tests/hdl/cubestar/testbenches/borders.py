"""The SRAM address never leaves the picture, also where nothing is stored or read."""

import random
from collections.abc import Iterable

import cocotb

from cubestack.hdl.contract.bench.camera import flat, frame, line, lines, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.testbench import checked_test
from cubestack.hdl.contract.bench.watching import stays_in_the_picture
from tests.hdl.cubestar.board import PublishedTestbench

COLUMNS, ROWS = GEOMETRY


def rows_of(sizes: Iterable[int]) -> list[Tick]:
    return flat(line(random.randbytes(size)) for size in sizes)


@checked_test(PublishedTestbench)
async def with_lines_of_any_length(bench: PublishedTestbench) -> None:
    cocotb.start_soon(stays_in_the_picture(bench.dut.SRAM_A))
    whole, short = [COLUMNS] * (ROWS - 1), [1] * (ROWS - 1)
    for rows in ([*whole, 1], [*short, COLUMNS - 1], [*whole, COLUMNS + 1], [*short, 3 * COLUMNS]):
        await bench.store(random.getrandbits(1))
        bench.camera.send([*frame(b""), *rows_of(rows), *rows_of([1, COLUMNS, 2 * COLUMNS])])
        bench.camera.send([*frame(picture()), *flat(lines(picture()))])
        await bench.camera.sent()
        await bench.mcu.standby()
