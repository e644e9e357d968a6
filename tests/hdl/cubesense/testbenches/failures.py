"""What still works with a camera dead, a memory failed, or both."""

import random
from typing import Any

import cocotb

from tests.hdl.coverage.hits import hit
from tests.hdl.cubesense.pair import OTHER, SIDES, PairTestbench, with_sun
from tests.hdl.cubesense.settings import READ_OUT
from tests.hdl.harness.testbench import timed_test

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


async def measures(bench: PairTestbench, sensor: str, memory: str) -> None:
    """From standby: a picture is stored, read as a whole, and its edge data read."""
    x, y = random.randrange(COLUMNS - 2), random.randrange(ROWS)
    content = await bench.shoot((sensor, memory), with_sun(x, y))
    assert await bench.fetch((sensor, memory)) == content
    await bench.mcu.read_edge(sensor, memory)
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


@timed_test
@cocotb.parametrize(failed=SIDES)
async def memory_failed(dut: Any, failed: str) -> None:
    """Each sensor measures with the other memory."""
    bench = await PairTestbench.start(dut, failed_sram=failed)
    for sensor in random.sample(SIDES, 2):
        await measures(bench, sensor, OTHER[failed])


@timed_test
@cocotb.parametrize(dead=SIDES)
async def camera_dead(dut: Any, dead: str) -> None:
    """The other sensor measures with either memory."""
    bench = await PairTestbench.start(dut, dead_camera=dead)
    for memory in random.sample(SIDES, 2):
        await measures(bench, OTHER[dead], memory)
    await bench.check()


@timed_test
@cocotb.parametrize(dead=SIDES)
async def camera_dead_and_memory_failed(dut: Any, dead: str) -> None:
    """The other sensor, whose memory failed, measures with the dead camera's memory."""
    bench = await PairTestbench.start(dut, dead_camera=dead, failed_sram=OTHER[dead])
    for _ in range(2):
        await measures(bench, OTHER[dead], dead)


@timed_test
async def dead_camera_is_waited_for_in_standby(dut: Any) -> None:
    """Storing from it never starts: no ACK, no chip enable, nothing written; then all works."""
    bench = await PairTestbench.start(dut, dead_camera="nadir")
    for memory in SIDES:
        await bench.mcu.store("nadir", memory)
        assert not await bench.mcu.acknowledged(memory, 10**6)
        assert int(dut.NAD_SRAM_CE_N.value)
        assert int(dut.SUN_SRAM_CE_N.value)
        await bench.mcu.standby()
    await measures(bench, "sun", "nadir")
    await bench.check()
