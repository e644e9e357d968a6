"""Frames of full size on any pair; cubesense_full_frame.v is around it and does the counting."""

from typing import Any

from cocotb.triggers import First, RisingEdge, Timer

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, Action
from cubestack.hdl.contract.bench.watching import levels
from cubestack.hdl.contract.cubesense.bench import SIDES, row
from cubestack.hdl.contract.cubesense.points import hit
from cubestack.hdl.contract.testing import contract_test

SUN, NADIR = 0, 1
PICTURE, SCAN, WINDOW = 0, 1, 2
CLOCKS = {PICTURE: FULL_SIZE.pixels, SCAN: FULL_SIZE.scan_clocks, WINDOW: 4 + FULL_SIZE.window**2}
ACKS = "SUNACK", "NADACK"


async def _standby(dut: Any) -> None:
    dut.SUNEN.value = dut.NADEN.value = 1
    await Timer(1, unit="us")


async def _command(dut: Any, **wanted: Action) -> None:
    dut.SHIFT.value, dut.EDGE.value, dut.RNW.value, *enables = row(**wanted)
    await Timer(1, unit="us")
    dut.SUNEN.value, dut.NADEN.value = enables
    await Timer(1, unit="us")


async def _acknowledged(dut: Any, side: int) -> None:
    ack = getattr(dut, ACKS[side])
    if not int(ack.value):
        await First(RisingEdge(ack), Timer(80, unit="ms"))
    assert int(ack.value), f"no {ACKS[side]}"


async def _stored(dut: Any, memory: int, camera: int, frame: int) -> None:
    dut.memory.value, dut.camera.value, dut.expected.value = memory, camera, frame
    dut.look.value = 1
    await Timer(1, unit="ns")
    wrong = int(dut.wrong_in_memory.value)
    assert not wrong, f"{wrong} pixels are not in the {SIDES[memory]} memory"
    dut.look.value = 0
    place = {"camera": SIDES[camera], "memory": SIDES[memory]}
    hit("image", **place, done="stored")


async def _reads(dut: Any, order: int, camera: int) -> None:
    """Clock out one read-out of the frame that was compared last, and go to standby."""
    dut.order.value, dut.camera.value = order, camera
    dut.read.value = 1
    await RisingEdge(dut.read_done)
    wrong = int(dut.wrong_in_data.value)
    assert not wrong, f"{wrong} data clocks presented a wrong byte"
    assert int(dut.clocks.value) == CLOCKS[order]
    dut.read.value = 0
    await _standby(dut)


@contract_test(timeout_ms=1000)
async def stores_and_reads_whole_frames(dut: Any) -> None:
    """Both at once, then across the link while the Sun's camera is dead."""
    await Timer(1, unit="us")
    await _command(dut, sun=Action.STORE, nadir=Action.STORE)
    for side in (SUN, NADIR):
        await _acknowledged(dut, side)
    await Timer(100, unit="us")
    await _standby(dut)
    for name, pulses in levels(dut, ("sun_pulses", "nadir_pulses")).items():
        assert pulses == FULL_SIZE.pixels, f"{pulses} {name}, not {FULL_SIZE.pixels}"
    await _stored(dut, SUN, SUN, 1)
    await _command(dut, sun=Action.EDGE)
    await _reads(dut, WINDOW, SUN)
    await _stored(dut, NADIR, NADIR, 1)
    await _command(dut, nadir=Action.EDGE)
    await _reads(dut, SCAN, NADIR)

    dut.sun_camera_alive.value = 0
    frame = int(dut.frame[NADIR].value) + (int(dut.line[NADIR].value) < FULL_SIZE.rows + 40)
    await _command(dut, sun=Action.STORE_OTHER)
    await _acknowledged(dut, SUN)
    await _standby(dut)
    await _stored(dut, SUN, NADIR, frame)
    await _command(dut, sun=Action.SEND_EDGE)
    await _reads(dut, SCAN, NADIR)
    await _command(dut, sun=Action.READ)
    await _reads(dut, PICTURE, NADIR)
    moved, clashes = levels(dut, ("unstable", "contention")).values()
    assert not moved, f"{moved} times address or data moved in a write pulse"
    assert not clashes, f"{clashes} times a wire had two drivers"
