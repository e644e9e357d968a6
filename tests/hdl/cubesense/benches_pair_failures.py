"""What still works with a camera dead, a memory failed, or both."""

import random
from typing import Any

from bench import timed_test
from cover import hit
from geometry import GEOMETRY
from pair import OTHER, PairBench
from small import READ_OUT

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


async def measures(bench: PairBench, sensor: str, memory: str) -> None:
    """From standby: a picture is stored, read as a whole, and its edge data read."""
    content = bytearray(random.choices(range(200), k=GEOMETRY.pixels))
    x, y = random.randrange(COLUMNS - 2), random.randrange(ROWS)
    content[y * COLUMNS + x : y * COLUMNS + x + 3] = bytes([255, 200, 254])
    await bench.shoot(sensor, memory, bytes(content))
    await bench.mcu.read_picture(memory)
    assert await bench.mcu.read(GEOMETRY.pixels) == content
    await bench.mcu.standby()
    if sensor == memory:
        await bench.mcu.read_edge(sensor)
    else:
        await bench.mcu.read_edge_linked(sensor)
    if sensor == "sun":
        data = await bench.mcu.read(4)
        assert data == x.to_bytes(2, "little") + y.to_bytes(2, "little")
        left, top = READ_OUT.window_origin(x, y)
        for row in range(top, top + READ_OUT.window):
            expected = content[row * COLUMNS + left :][: READ_OUT.window]
            assert await bench.mcu.read(READ_OUT.window) == expected
    else:
        pixels = list(READ_OUT.scan())
        data = await bench.mcu.read(len(pixels))
        for value, pixel in zip(data, pixels, strict=True):
            assert pixel is None or value == content[pixel[1] * COLUMNS + pixel[0]]
    await bench.mcu.standby()
    parts = {"dead": bench.dead_camera, "failed": bench.failed_sram}
    hit("failures", sensor=sensor, memory=memory, **parts)


async def memory_failed(dut: Any, failed: str) -> None:
    """Each sensor measures with the other memory."""
    bench = await PairBench.start(dut, failed_sram=failed)
    for sensor in random.sample(["sun", "nadir"], 2):
        await measures(bench, sensor, OTHER[failed])


async def camera_dead(dut: Any, dead: str) -> None:
    """The other sensor measures with either memory."""
    bench = await PairBench.start(dut, dead_camera=dead)
    for memory in random.sample(["sun", "nadir"], 2):
        await measures(bench, OTHER[dead], memory)
    await bench.check()


async def camera_dead_and_memory_failed(dut: Any, dead: str) -> None:
    """The other sensor, whose memory failed, measures with the dead camera's memory."""
    bench = await PairBench.start(dut, dead_camera=dead, failed_sram=OTHER[dead])
    for _ in range(2):
        await measures(bench, OTHER[dead], dead)


@timed_test
async def sun_memory_failed(dut: Any) -> None:
    await memory_failed(dut, "sun")


@timed_test
async def nadir_memory_failed(dut: Any) -> None:
    await memory_failed(dut, "nadir")


@timed_test
async def sun_camera_dead(dut: Any) -> None:
    await camera_dead(dut, "sun")


@timed_test
async def nadir_camera_dead(dut: Any) -> None:
    await camera_dead(dut, "nadir")


@timed_test
async def sun_camera_dead_and_nadir_memory_failed(dut: Any) -> None:
    await camera_dead_and_memory_failed(dut, "sun")


@timed_test
async def nadir_camera_dead_and_sun_memory_failed(dut: Any) -> None:
    await camera_dead_and_memory_failed(dut, "nadir")


@timed_test
async def dead_camera_is_waited_for_in_standby(dut: Any) -> None:
    """Storing from it never starts: no ACK, no chip enable, nothing written; then all works."""
    bench = await PairBench.start(dut, dead_camera="nadir")
    for store in (bench.mcu.store, bench.mcu.store_linked):
        await store("nadir")
        assert not await bench.mcu.acknowledged("nadir", 10**6)
        assert int(dut.NAD_SRAM_CE_N.value)
        assert int(dut.SUN_SRAM_CE_N.value)
        await bench.mcu.standby()
    await measures(bench, "sun", "nadir")
    await bench.check()
