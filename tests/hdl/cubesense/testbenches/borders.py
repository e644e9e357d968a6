"""Border cases of storing on every way from a camera to a memory, each one for certain."""

import random
from collections.abc import Sequence
from itertools import product
from typing import Any, Self

import cocotb

from cubestack.hdl.contract.bench.camera import flat, line, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.testbench import checked_test
from cubestack.hdl.contract.bench.watching import stays_in_the_picture
from tests.hdl.cubesense.pair import PREFIXES, PairTestbench
from tests.hdl.cubesense.reference import READ_OUT, SIDES

COLUMNS, ROWS, GAP = READ_OUT.columns, READ_OUT.rows, READ_OUT.frame_gap
WAYS = list(product(SIDES, SIDES))

#: Sizes of a frame's lines.
FRAMES = (
    [3 * COLUMNS] * ROWS,
    [*[COLUMNS] * (ROWS - 1), COLUMNS - 1, *[COLUMNS] * 3],
    [*[1] * (ROWS - 1), COLUMNS, *[2 * COLUMNS] * 2],
    [*[COLUMNS + 1, COLUMNS - 1] * ROWS],
)


class WatchedTestbench(PairTestbench):
    @classmethod
    async def start(cls, dut: Any, *timing: Any, **broken: Any) -> Self:
        bench = await super().start(dut, *timing, **broken)
        for prefix in PREFIXES.values():
            cocotb.start_soon(stays_in_the_picture(getattr(dut, f"{prefix}_SRAM_A")))
        return bench


async def sends(bench: PairTestbench, way: tuple[str, str], ticks: Sequence[Tick]) -> None:
    await bench.store(way)
    source = bench.camera_of(way)
    source.send(ticks)
    await source.sent()
    await source.reach(len(source.clocks) + 2)
    await bench.mcu.standby()


def rows_of(sizes: Sequence[int]) -> list[Tick]:
    return flat(list(line(random.randbytes(size), random.randrange(1, GAP))) for size in sizes)


@checked_test(WatchedTestbench)
async def lines_and_frames_of_any_length(bench: PairTestbench) -> None:
    for way in random.sample(WAYS, len(WAYS)):
        for sizes in FRAMES:
            await sends(bench, way, [*vsync(GAP + 1), *rows_of(sizes), *rows_of([1, COLUMNS])])


@checked_test(WatchedTestbench)
async def gaps_of_about_the_length_of_one(bench: PairTestbench) -> None:
    """One clock more is needed; what is shorter ends a line at most."""
    for way in random.sample(WAYS, len(WAYS)):
        for lows in ((GAP, GAP + 1), (GAP + 1, GAP), (GAP - 1, GAP + 2)):
            parts = [[*vsync(low), *rows_of([COLUMNS] * (ROWS - 1))] for low in lows]
            await sends(bench, way, [*flat(parts), *rows_of([COLUMNS])])


@checked_test(WatchedTestbench)
async def brightness_just_below_that_of_the_sun(bench: PairTestbench) -> None:
    """Three of 200 and more count, and no others."""
    levels = [range(200, 256)] * 2 + [range(192, 200), range(128, 200)] * 4
    for memory in (*SIDES, *SIDES) * 3:
        content = bytes(random.choice(random.choice(levels)) for _ in range(GEOMETRY.pixels))
        await bench.shoot(("sun", memory), content)
        await bench.read_edge("sun", memory, 4)
