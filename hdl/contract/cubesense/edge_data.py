"""Tests of CubeSense's contract in edge data: the nadir scan and the Sun window."""

import random
from typing import Any

from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.contract import Size
from cubestack.hdl.contract.cubesense.bench import (
    OTHER,
    READ_OUT,
    SIDES,
    PairBench,
    Place,
    edge_row,
)
from cubestack.hdl.contract.cubesense.points import hit
from cubestack.hdl.contract.cubesense.sizes import not_found
from cubestack.hdl.contract.testing import contract_test

COLUMNS, ROWS = GEOMETRY
SUN, NADIR = SIDES

NOT_FOUND = not_found(Size(COLUMNS, ROWS))


def dark(*bright: tuple[int, int]) -> bytes:
    """An image whose only bright pixels begin at each (x, y), ``SUN_RUN`` of them."""
    content = bytearray(random.choices(range(SUN_THRESHOLD), k=GEOMETRY.pixels))
    for x, y in bright:
        start = y * COLUMNS + x
        content[start : start + SUN_RUN] = random.choices(range(SUN_THRESHOLD, 256), k=SUN_RUN)
    return bytes(content)


def darker(content: bytes, x: int, y: int) -> bytes:
    """With one pixel as bright as no Sun pixel is."""
    place = y * COLUMNS + x
    return content[:place] + bytes([SUN_THRESHOLD - 1]) + content[place + 1 :]


@contract_test()
async def presents_the_nadir_scan(dut: Any) -> None:
    """Of the nadir camera's image in either memory, and some clocks beyond its end."""
    bench = await PairBench.start(dut, cameras=())  # with them it takes long at full size
    for memory in SIDES:
        place = Place(NADIR, memory)
        await bench.presents(edge_row(place), bench.scan(memory, ROWS + 2))
        hit("edge", **place._asdict())


@contract_test()
async def presents_the_sun_window(dut: Any) -> None:
    """Around the first Sun pixel of the Sun camera's image in either memory."""
    bench = await PairBench.start(dut)
    last = COLUMNS - SUN_RUN
    for place in (Place(SUN, memory) for memory in SIDES):
        inside = random.randrange(1, last), random.randrange(1, ROWS - 1)
        corner = random.choice((0, last)), random.choice((0, ROWS - 1))
        two = random.randrange(1, last), random.randrange(ROWS - 1)
        cases = {
            "inside": (dark(inside, (last, ROWS - 1)), inside),
            "at the border": (dark(corner), corner),
            "after two bright pixels": (
                darker(dark(two, (last, ROWS - 1)), two[0] + SUN_RUN - 1, two[1]),
                (last, ROWS - 1),
            ),
            "across the end of a row": (
                dark((COLUMNS - random.randrange(1, SUN_RUN), 0), (last, ROWS - 1)),
                (last, ROWS - 1),
            ),
            "none": (dark(), NOT_FOUND),
        }
        for case in random.sample(sorted(cases), len(cases)):
            content, found = cases[case]
            await bench.shoot(place, content)
            wanted = bench.window(place.memory, *found, further=READ_OUT.window + 1)
            await bench.presents(edge_row(place), wanted[:4] if case == "none" else wanted)
            hit("sun", memory=place.memory, case=case)
        hit("edge", **place._asdict())


@contract_test()
async def keeps_the_sun_pixel(dut: Any) -> None:
    """Whatever else is stored, until the next Sun image is stored in that memory."""
    bench = await PairBench.start(dut)
    for memory in SIDES:
        place = Place(SUN, memory)
        found = random.randrange(COLUMNS - SUN_RUN + 1), random.randrange(ROWS)
        await bench.shoot(place, dark(found))
        for other in (Place(NADIR, memory), Place(SUN, OTHER[memory]), Place(NADIR, NADIR)):
            await bench.shoot(other, dark((0, 0)) if other.camera == SUN else None)
            await bench.presents(edge_row(place), bench.window(memory, *found, further=0))
        hit("sun", memory=memory, case="kept while others are stored")
