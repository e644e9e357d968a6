"""Full-size pictures of both cameras; see cubesense_full_frame.v, which does the counting."""

from typing import Any

import cocotb
from cocotb.triggers import First, RisingEdge, Timer

from tests.hdl.cubesense.reference import READ_OUT

SUN, NADIR = 0, 1
PICTURE, SCAN, WINDOW = 0, 1, 2


async def standby(dut: Any) -> None:
    dut.SUNEN.value = dut.NADEN.value = 1
    await Timer(1, unit="us")


async def command(dut: Any, SUNEN: int, NADEN: int, **lines: int) -> None:
    for name, level in lines.items():
        getattr(dut, name).value = level
    await Timer(1, unit="us")
    dut.SUNEN.value, dut.NADEN.value = SUNEN, NADEN
    await Timer(1, unit="us")


async def stored(dut: Any, memory: int, camera: int, frame: int) -> None:
    dut.memory.value, dut.camera.value, dut.expected.value = memory, camera, frame
    dut.look.value = 1
    await Timer(1, unit="ns")
    assert int(dut.wrong_in_memory.value) == 0
    dut.look.value = 0


async def reads(dut: Any, order: int, camera: int, clocks: int) -> None:
    """Clock out one read-out of the frame that was compared last, and go to standby."""
    dut.order.value, dut.camera.value = order, camera
    dut.read.value = 1
    await RisingEdge(dut.read_done)
    assert int(dut.wrong_in_data.value) == 0
    assert int(dut.clocks.value) == clocks
    dut.read.value = 0
    await standby(dut)


@cocotb.test()
async def both_at_once_then_across_the_link(dut: Any) -> None:
    await Timer(1, unit="us")
    await command(dut, SHIFT=0, EDGE=0, RNW=0, SUNEN=0, NADEN=0)
    for ack in (dut.SUNACK, dut.NADACK):
        if not int(ack.value):
            await First(RisingEdge(ack), Timer(80, unit="ms"))
        assert int(ack.value)
    await Timer(100, unit="us")
    await standby(dut)
    assert int(dut.sun_pulses.value) == int(dut.nadir_pulses.value) == READ_OUT.pixels
    await stored(dut, SUN, SUN, 1)
    await command(dut, SHIFT=0, EDGE=1, RNW=1, SUNEN=0, NADEN=1)
    await reads(dut, WINDOW, SUN, 4 + 15 * 15)
    await stored(dut, NADIR, NADIR, 1)
    await command(dut, SHIFT=0, EDGE=1, RNW=1, SUNEN=1, NADEN=0)
    await reads(dut, SCAN, NADIR, 1 + 8 * 640 + 1 + 10 * 480)

    # The sun camera dies; the nadir camera's next picture goes to the sun's memory.
    dut.sun_camera_alive.value = 0
    frame = int(dut.frame[NADIR].value) + (int(dut.line[NADIR].value) < 480 + 40)
    await command(dut, SHIFT=1, EDGE=0, RNW=1, SUNEN=0, NADEN=0)
    await First(RisingEdge(dut.SUNACK), Timer(80, unit="ms"))
    await standby(dut)
    await stored(dut, SUN, NADIR, frame)
    await command(dut, SHIFT=1, EDGE=1, RNW=1, SUNEN=0, NADEN=0)
    await reads(dut, SCAN, NADIR, READ_OUT.scan_clocks)
    await command(dut, SHIFT=0, EDGE=0, RNW=1, SUNEN=0, NADEN=1)
    await reads(dut, PICTURE, NADIR, READ_OUT.pixels)
    assert int(dut.unstable.value) == int(dut.contention.value) == 0
