"""Reading pictures and edge data, from own memory and across the link."""

import os
import random
from itertools import product

from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import checked_test
from tests.hdl.cubesense.pair import OTHER, PairTestbench, frame, window_of, with_sun
from tests.hdl.cubesense.reference import NOT_FOUND, READ_OUT, SIDES

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


@checked_test(PairTestbench)
async def pictures(bench: PairTestbench) -> None:
    """From the first pixel on, however far the last reading came, and past the last one."""
    for count in (3, GEOMETRY.pixels // 2, GEOMETRY.pixels + COLUMNS + 1, 1):
        for side in SIDES:
            assert await bench.read(side, count) == (2 * bench.content(side))[:count]


@checked_test(PairTestbench)
async def nadir_scan(bench: PairTestbench) -> None:
    """Each clock of a line presents its pixel, from either memory."""
    for memory in random.sample(SIDES, 2):
        await bench.shoot(("nadir", memory), picture())
        rows = [bench.content(memory)[y * COLUMNS :][:COLUMNS] for y in range(ROWS)]
        horizontal = b"".join(rows[y] for y in READ_OUT.scan_rows)
        vertical = b"".join(bytes(row[x] for row in rows) for x in READ_OUT.scan_columns)
        data = await bench.read_edge("nadir", memory, READ_OUT.scan_clocks + 5)
        assert data[1:][: len(horizontal)] == horizontal
        assert data[1 + len(horizontal) + 1 :] == vertical + vertical[:5]
        assert (await bench.read_edge("nadir", memory, 4))[1:] == horizontal[:3]


@checked_test(PairTestbench)
async def sun_window(bench: PairTestbench) -> None:
    """Around Suns in the middle, at the borders and in the corners, and around none."""
    columns, rows = (0, COLUMNS // 2, COLUMNS - 3), (0, ROWS // 2, ROWS - 1)
    cases = list(product([*product(columns, rows), NOT_FOUND], SIDES))
    everything = os.environ.get("HDL_TIER") == "full"
    for (x, y), memory in cases if everything else random.sample(cases, 5):
        content = with_sun(x, y)
        await bench.shoot(("sun", memory), content)
        window = window_of(content, x, y)
        expected = bytes([x & 255, x >> 8, y & 255, y >> 8]) + window + window[:2]
        assert await bench.read_edge("sun", memory, len(expected)) == expected
        assert await bench.read_edge("sun", memory, 5) == expected[:5]


@checked_test(PairTestbench)
async def orders_start_anew_without_standby(bench: PairTestbench) -> None:
    """EDGE may change while an FPGA is enabled."""
    await bench.shoot(("sun", "sun"), with_sun(4, 2))
    for side in SIDES:
        await bench.mcu.read_picture(side)
        for edge in (1, 0, 1, 0):
            await bench.mcu.read(random.randrange(1, 9))
            await bench.mcu.set(EDGE=edge)
        await bench.mcu.read(3)
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def while_cameras_send(bench: PairTestbench) -> None:
    """No camera's clock reaches a read-out."""
    await bench.shoot(("sun", "nadir"), with_sun(6, 3))
    await bench.shoot(("sun", "sun"), with_sun(3, 3))
    for camera in bench.cameras.values():
        for _ in range(20):
            camera.send(frame(picture()))
    for _ in range(12):
        sensor, memory = random.choice(SIDES), random.choice(SIDES)
        await bench.read_edge(sensor, memory, random.randrange(1, 40))
        await bench.read(OTHER[memory], random.randrange(1, 20))
