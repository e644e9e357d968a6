"""The scan alone: exactly the declared addresses, in order."""

import random
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import clock
from tests.hdl.cubesense.reference import READ_OUT

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


def pixels_by_hand() -> list[tuple[int, int] | None]:
    rows = range(READ_OUT.first_row, ROWS, READ_OUT.scan_step)
    columns = range(READ_OUT.first_column, COLUMNS, READ_OUT.scan_step)
    along_rows = [(x, y) for y in rows for x in range(COLUMNS)]
    return [None, *along_rows, None, *((x, y) for x in columns for y in range(ROWS))]


def addresses(count: int) -> list[int]:
    """What the first ``count`` clocks present; the presets look at address 0."""
    pixels = pixels_by_hand()
    columns = pixels[1 + pixels[1:].index(None) + 1 :]
    while len(pixels) < count:
        pixels += columns
    return [0 if pixel is None else GEOMETRY.address(*pixel) for pixel in pixels[:count]]


@cocotb.test()
async def declared_order(dut: Any) -> None:
    assert list(READ_OUT.scan()) == pixels_by_hand()
    assert READ_OUT.scan_clocks == len(pixels_by_hand())


@cocotb.test()
async def visits_the_declared_pixels_in_order(dut: Any) -> None:
    once = READ_OUT.scan_clocks
    for count in (once // 3, once + 1, 3 * once, random.randrange(once)):
        await clock(dut, "scan", reset=1)
        for expected in addresses(count):
            assert int(dut.address.value) == expected
            await clock(dut, "scan")
