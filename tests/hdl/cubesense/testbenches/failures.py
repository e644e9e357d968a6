"""What still works with a camera dead, a memory failed, or both."""

import random
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.testbench import timed_test
from tests.hdl.coverage.points import hit
from tests.hdl.cubesense.pair import OTHER, SIDES, PairTestbench, coordinates, window_of, with_sun
from tests.hdl.cubesense.reference import READ_OUT

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


async def measures(bench: PairTestbench, sensor: str, memory: str) -> None:
    """From standby: a picture is stored, read as a whole, and its edge data read."""
    x, y = random.randrange(COLUMNS - 2), random.randrange(ROWS)
    content = await bench.shoot((sensor, memory), with_sun(x, y))
    assert await bench.fetch((sensor, memory)) == content
    await bench.mcu.read_edge(sensor, memory)
    if sensor == "sun":
        assert await bench.mcu.read(4) == coordinates(x, y)
        assert await bench.mcu.read(READ_OUT.window**2) == window_of(content, x, y)
    else:
        for pixel in READ_OUT.scan():
            value = await bench.mcu.clock()
            assert pixel is None or value == content[pixel[1] * COLUMNS + pixel[0]]
    await bench.mcu.standby()
    parts = {"dead": bench.dead_camera, "failed": bench.failed_sram}
    hit("failures", sensor=sensor, memory=memory, **parts)


@timed_test
@cocotb.parametrize(side=SIDES, broken=("memory", "camera", "both"))
async def what_works_still_measures(dut: Any, side: str, broken: str) -> None:
    """With a side's memory failed, each sensor in the other one; with a camera dead, the other
    sensor in either memory, or in the dead camera's when its own failed.
    """
    other, some = OTHER[side], random.sample(SIDES, 2)
    dead, failed, cases = {
        "memory": ("", side, [(sensor, other) for sensor in some]),
        "camera": (side, "", [(other, memory) for memory in some]),
        "both": (side, other, [(other, side)] * 2),
    }[broken]
    bench = await PairTestbench.start(dut, dead_camera=dead, failed_sram=failed)
    for sensor, memory in cases:
        await measures(bench, sensor, memory)
    if not failed:
        await bench.check()


@timed_test
async def dead_camera_is_waited_for_in_standby(dut: Any) -> None:
    """Storing from it never starts: no ACK, no chip enable, nothing written; then all works."""
    bench = await PairTestbench.start(dut, dead_camera="nadir")
    for memory in SIDES:
        await bench.mcu.store("nadir", memory)
        assert not await bench.mcu.acknowledged(memory, 10**6)
        assert int(dut.NAD_SRAM_CE_N.value) & int(dut.SUN_SRAM_CE_N.value)
        await bench.mcu.standby()
    await measures(bench, "sun", "nadir")
    await bench.check()
