"""Border cases of storing on every way from a camera to a memory, each one for certain."""

import random
from collections.abc import Sequence
from itertools import product
from typing import Any

import cocotb

from tests.hdl.cubesense.pair import PREFIXES, PairTestbench
from tests.hdl.cubesense.reference import SIDES
from tests.hdl.cubesense.settings import READ_OUT
from tests.hdl.harness.camera import flat, line, vsync
from tests.hdl.harness.geometry import GEOMETRY
from tests.hdl.harness.reference import Tick
from tests.hdl.harness.testbench import timed_test
from tests.hdl.harness.watching import stays_in_the_picture

COLUMNS, ROWS, GAP = READ_OUT.columns, READ_OUT.rows, READ_OUT.frame_gap
WAYS = list(product(SIDES, SIDES))

#: Sizes of a frame's lines.
FRAMES = (
    [3 * COLUMNS] * ROWS,
    [*[COLUMNS] * (ROWS - 1), COLUMNS - 1, *[COLUMNS] * 3],
    [*[1] * (ROWS - 1), COLUMNS, *[2 * COLUMNS] * 2],
    [*[COLUMNS + 1, COLUMNS - 1] * ROWS],
)


async def start(dut: Any) -> PairTestbench:
    """The bench, with an eye on the addresses."""
    bench = await PairTestbench.start(dut)
    for prefix in PREFIXES.values():
        cocotb.start_soon(stays_in_the_picture(getattr(dut, f"{prefix}_SRAM_A")))
    return bench


async def sends(bench: PairTestbench, way: tuple[str, str], ticks: Sequence[Tick]) -> None:
    """From standby to standby: a camera sends this while it is stored."""
    await bench.store(way)
    source = bench.camera_of(way)
    source.send(ticks)
    await source.sent()
    await source.reach(len(source.clocks) + 2)
    await bench.mcu.standby()


def rows_of(sizes: Sequence[int]) -> list[Tick]:
    """Lines of so many random pixels, without a gap between them."""
    return flat(list(line(random.randbytes(size), random.randrange(1, GAP))) for size in sizes)


@timed_test
async def lines_and_frames_of_any_length(dut: Any) -> None:
    bench = await start(dut)
    for way in random.sample(WAYS, len(WAYS)):
        for sizes in FRAMES:
            await sends(bench, way, [*vsync(GAP + 1), *rows_of(sizes), *rows_of([1, COLUMNS])])
    await bench.check()


@timed_test
async def gaps_of_about_the_length_of_one(dut: Any) -> None:
    """One clock more is needed; what is shorter ends a line at most."""
    bench = await start(dut)
    for way in random.sample(WAYS, len(WAYS)):
        for lows in ((GAP, GAP + 1), (GAP + 1, GAP), (GAP - 1, GAP + 2)):
            parts = [[*vsync(low), *rows_of([COLUMNS] * (ROWS - 1))] for low in lows]
            await sends(bench, way, [*flat(parts), *rows_of([COLUMNS])])
    await bench.check()


def nearly_bright() -> int:
    """A pixel around the threshold."""
    return random.choice([random.randrange(192, 200), random.randrange(128, 200)])


@timed_test
async def brightness_just_below_that_of_the_sun(dut: Any) -> None:
    """Three of 200 and more count, and no others."""
    bench = await start(dut)
    for memory in (*SIDES, *SIDES):
        for _ in range(3):
            content = [
                random.randrange(200, 256) if random.random() < 0.2 else nearly_bright()
                for _ in range(GEOMETRY.pixels)
            ]
            await bench.shoot(("sun", memory), bytes(content))
            await bench.read_edge("sun", memory, 4)
    await bench.check()
