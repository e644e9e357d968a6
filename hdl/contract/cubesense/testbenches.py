"""Tests of CubeSense's contract in storing, reading and standby."""

import random
from typing import Any

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import flat, line, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import ODD, wait
from cubestack.hdl.contract.cubesense.bench import (
    LATENCY,
    OTHER,
    PAUSE,
    PLACES,
    READ_OUT,
    SIDES,
    PairBench,
    Place,
    store_row,
)
from cubestack.hdl.contract.cubesense.points import IDLE_ROWS, hit
from cubestack.hdl.contract.testing import contract_test

COLUMNS, ROWS = GEOMETRY
OWN = tuple(place for place in PLACES if place.way == "own")

#: So much of an image, never a whole one.
PART = min(GEOMETRY.pixels - 1, 2 * COLUMNS)


def picture() -> bytes:
    return random.randbytes(GEOMETRY.pixels)


@contract_test()
async def stores_and_reads_back(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for place in PLACES * 2:
        other = bench.stored(OTHER[place.memory])
        await bench.shoot(place)
        assert bench.stored(OTHER[place.memory]) == other, "the other memory has changed"
        hit("image", **place._asdict(), done="stored")
        await bench.read_back(place.memory, GEOMETRY.pixels)
        hit("image", **place._asdict(), done="read")


@contract_test()
async def stores_both_at_once(dut: Any) -> None:
    bench = await PairBench.start(dut)
    await bench.store(*OWN)
    contents = {place: picture() for place in OWN}
    for place, content in contents.items():
        bench.cameras[place.camera].send(bench.frame(place, content))
    for place in OWN:
        await bench.cameras[place.camera].sent()
        assert await bench.acknowledged(place), f"no {place.memory} ACK"
    await bench.standby()
    for place, content in contents.items():
        assert bench.stored(place.memory) == content, "the memory changed after ACK"
        hit("image", **place._asdict(), done="stored beside the other")


@contract_test()
async def acknowledges_only_whole_frames(dut: Any) -> None:
    """Joined at any row, or cut short by a gap; the next frame is stored in its place."""
    bench = await PairBench.start(dut)
    for place in PLACES:
        camera = bench.cameras[place.camera]
        levels = store_row(place)
        await bench.mcu.set(**dict(zip(("SHIFT", "EDGE", "RNW"), levels, strict=False)))
        bench.whole[place.memory] = []
        start = await camera.begin(bench.rows(picture()))
        gap = READ_OUT.frame_gap + 2 * LATENCY
        await camera.reach(start + gap + random.randrange(GEOMETRY.pixels - COLUMNS))
        await bench.mcu.set(1, SUNEN=levels[3], NADEN=levels[4])
        await camera.sent()
        assert not await bench.acknowledged(place), "ACK is early: the frame was joined"
        await bench.sends(place, bench.frame(place, picture()))
        await bench.is_stored(place)
        hit("border", **place._asdict(), case="joined in a frame")

        await bench.store(place)
        await bench.sends(place, bench.rows(picture()[: COLUMNS * random.randrange(1, ROWS)]))
        content = picture()
        bench.whole[place.memory].append(content)
        await bench.sends(place, bench.rows(content, READ_OUT.frame_gap + 1 - PAUSE))
        await bench.is_stored(place)
        assert bench.stored(place.memory) == content, "the memory changed after ACK"
        hit("border", **place._asdict(), case="frame too short")


@contract_test()
async def a_pause_is_no_gap(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for place in PLACES:
        await bench.store(place)
        ticks = bench.frame(place, picture())
        middle = len(ticks) - (COLUMNS + PAUSE) * random.randrange(1, ROWS)
        ticks[middle:middle] = vsync(READ_OUT.frame_gap - PAUSE)
        await bench.sends(place, ticks)
        await bench.is_stored(place)
        hit("border", **place._asdict(), case="pause as long as a gap")


@contract_test()
async def last_row_too_short(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for place in PLACES:
        await bench.store(place)
        await bench.sends(place, bench.rows(picture()[: -random.randrange(1, COLUMNS)]))
        assert not await bench.acknowledged(place), "ACK is early: the last row is too short"
        await bench.sends(place, bench.frame(place, picture()))
        await bench.is_stored(place)
        hit("border", **place._asdict(), case="last row too short")


@contract_test()
async def surplus_pixels_are_not_stored(dut: Any) -> None:
    """Rows that are too long, more rows than an image has, and frames after ACK."""
    bench = await PairBench.start(dut)
    for place in PLACES:
        content, surplus = picture(), random.choice((1, 2, COLUMNS))
        await bench.store(place)
        bench.whole[place.memory].append(content)
        rows = [content[n : n + COLUMNS] for n in range(0, len(content), COLUMNS)]
        sent = [line(row + random.randbytes(surplus), PAUSE) for row in [*rows, rows[0]]]
        ticks = [*vsync(READ_OUT.frame_gap + 2 * LATENCY), *flat(sent), *bench.rows(picture())]
        await bench.sends(place, ticks)
        assert int(bench.ack(place.memory).value), "no ACK, or it has fallen"
        assert bench.stored(place.memory) == content, "the memory changed after ACK"
        await bench.standby()
        hit("border", **place._asdict(), case="row too long")
        hit("border", **place._asdict(), case="rows after ACK")


@contract_test()
async def aborted_at_any_moment(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for place in PLACES * 2:
        camera = bench.cameras[place.camera]
        await bench.store(place)
        camera.send(bench.rows(picture()[:-1]))
        await wait(random.randrange(2 * GEOMETRY.pixels * camera.period), ODD)
        await bench.mcu.set(1, SUNEN=1, NADEN=1)
        await Timer(bench.latency, unit="step")
        assert not int(bench.ack(place.memory).value), "ACK stays high"
        await camera.sent()
        await bench.standby()
        await bench.shoot(place)
        hit("image", **place._asdict(), done="aborted")


@contract_test()
async def rows_are_stored_at_their_addresses(dut: Any) -> None:
    """The first rows of a frame, which is not acknowledged."""
    bench = await PairBench.start(dut)
    for place in PLACES:
        content = random.randbytes(PART)
        await bench.store(place)
        await bench.sends(place, bench.rows(content))
        assert not int(bench.ack(place.memory).value), "ACK without a whole frame"
        await bench.standby()
        assert bench.stored(place.memory)[:PART] == content, f"rows of the {place.camera} are wrong"


@contract_test()
async def outputs_rest_in_standby(dut: Any) -> None:
    """And in all rows that the command table does not have."""
    bench = await PairBench.start(dut)
    for side in SIDES:
        bench.cameras[side].send(bench.rows(random.randbytes(PART)))
    for levels in random.sample(IDLE_ROWS, len(IDLE_ROWS)):
        await bench.mcu.command(levels, after=1)
        for _ in range(3):
            await bench.mcu.clock()
            bench.in_standby()
        hit("idle row", levels=levels)
        await bench.standby()
    for side in SIDES:
        await bench.cameras[side].sent()
        bench.in_standby()
        assert not bench.srams[side].edges, "a write in standby"
        hit("standby", side=side)


@contract_test()
async def reads_without_a_camera(dut: Any) -> None:
    bench = await PairBench.start(dut, cameras=())
    for side in SIDES:
        await bench.read_back(side, PART)
        hit("read", side=side, camera="stopped")


@contract_test()
async def works_with_a_dead_camera(dut: Any) -> None:
    """The other one's image, in either memory."""
    alive = random.choice(SIDES)
    bench = await PairBench.start(dut, cameras=(alive,))
    for memory in SIDES:
        await bench.shoot(Place(alive, memory))
        await bench.read_back(memory, PART)


@contract_test()
async def writes_nothing_while_reading(dut: Any) -> None:
    bench = await PairBench.start(dut)
    for side in SIDES:
        bench.cameras[side].send(bench.rows(random.randbytes(PART)))
        await bench.read_back(side, PART)
        await bench.cameras[side].sent()
        hit("read", side=side, camera="runs")
