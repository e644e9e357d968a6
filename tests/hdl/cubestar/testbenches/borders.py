"""The SRAM address never leaves the picture, also where nothing is stored or read."""

import random
from collections.abc import Iterable

import cocotb

from tests.hdl.cubestar.board import PublishedTestbench
from tests.hdl.harness.camera import flat, frame, line, lines, picture
from tests.hdl.harness.reference import GEOMETRY, Tick
from tests.hdl.harness.testbench import checked_test
from tests.hdl.harness.watching import stays_in_the_picture

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
