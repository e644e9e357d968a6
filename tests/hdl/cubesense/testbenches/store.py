"""Storing pictures: own memory, both at once, and across the link."""

import random
from itertools import product
from typing import Any

from cubestack.hdl.contract.bench.camera import flat, line, lines, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from tests.hdl.cubesense.pair import OTHER, PREFIXES, PairTestbench, coordinates, frame, with_sun
from tests.hdl.cubesense.reference import NOT_FOUND, READ_OUT, SIDES

COLUMNS, ROWS, GAP = READ_OUT.columns, READ_OUT.rows, READ_OUT.frame_gap


@checked_test(PairTestbench)
async def every_camera_to_every_memory(bench: PairTestbench) -> None:
    for camera, memory in random.sample(PairTestbench.PLACES * 2, 8):
        other = bench.content(OTHER[memory])
        before = len(bench.srams[memory].pulses)
        await bench.shoot((camera, memory), picture())
        assert [pulse.address for pulse in bench.srams[memory].pulses[before:]] == [
            GEOMETRY.address(column, row) for row in range(ROWS) for column in range(COLUMNS)
        ]
        assert bench.content(OTHER[memory]) == other


@checked_test(PairTestbench)
async def both_at_once(bench: PairTestbench) -> None:
    """Each on its own clock; enabling or disabling one does not disturb the other."""
    for first, second in (SIDES, SIDES[::-1]):
        contents = {side: picture() for side in SIDES}
        first_en, second_en = (f"{PREFIXES[side]}EN" for side in (first, second))
        await bench.mcu.set(SHIFT=0, EDGE=0, RNW=0)
        await bench.mcu.set(**{first_en: 0})
        camera = bench.cameras[first]
        await camera.started()
        start = await camera.begin(frame(contents[first]))
        await camera.reach(start + random.randrange(GAP, GAP + GEOMETRY.pixels))
        for level in (0, 1, 0):
            await bench.mcu.set(camera.period // 4, **{second_en: level})
        camera = bench.cameras[second]
        await camera.started()
        camera.send(frame(contents[second]))
        assert await bench.mcu.acknowledged(second)
        assert await bench.mcu.acknowledged(first)
        await bench.mcu.standby()
        assert {side: bench.content(side) for side in SIDES} == contents


@checked_test(PairTestbench)
async def joined_anywhere(bench: PairTestbench) -> None:
    """A frame that is joined after its gap has begun is dropped, and the next one stored."""
    for _ in range(8):
        place = random.choice(bench.PLACES)
        camera, first = bench.camera_of(place), frame(picture())
        start = await camera.begin(first)
        await camera.reach(start + random.randrange(len(first) - 3))
        await bench.store(place)
        camera.send(frame(picture()))
        assert await bench.mcu.acknowledged(place[1])
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def ack_stays_and_nothing_more_is_stored(bench: PairTestbench) -> None:
    """Nor do the Sun's coordinates change, over gaps and whole frames."""
    for memory in SIDES:
        content = bytearray(GEOMETRY.pixels)
        content[2 * COLUMNS + 3 : 2 * COLUMNS + 6] = bytes([255] * 3)
        await bench.begin(("sun", memory), bytes(content))
        assert await bench.mcu.acknowledged(memory)
        sun = bench.cameras["sun"]
        sun.send([*frame(picture()), *frame(bytes([255]) * GEOMETRY.pixels), *frame(picture())])
        await sun.sent()
        assert int(getattr(bench.dut, f"{PREFIXES[memory]}ACK").value)
        await bench.mcu.standby()
        assert bench.content(memory) == bytes(content)
        assert await bench.read_edge("sun", memory, 4) == bytes([3, 0, 2, 0])


@checked_test(PairTestbench)
async def lines_too_long_and_too_short(bench: PairTestbench) -> None:
    """Surplus pixels and rows are ignored; what is missing stays as it was."""
    sizes = [COLUMNS, COLUMNS - 1, 1, COLUMNS + 1, 2 * COLUMNS]
    for _ in range(6):
        place = random.choice(bench.PLACES)
        await bench.store(place)
        source = bench.camera_of(place)
        rows = [random.randbytes(size) for size in (*random.choices(sizes, k=ROWS - 1), COLUMNS)]
        source.send([*frame(b"")[:-1], *flat(line(row) for row in rows)])
        source.send([*flat(lines(picture())), *frame(b"")])
        await source.sent()
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def sun_is_found_while_storing(bench: PairTestbench) -> None:
    """In either memory; the coordinates outlive standby and the nadir camera's pictures."""
    for _ in range(6):
        memory = random.choice(SIDES)
        x, y = random.randrange(COLUMNS - 2), random.randrange(ROWS)
        if random.random() >= 0.8:
            x, y = NOT_FOUND
        await bench.shoot(("sun", memory), with_sun(x, y))
        if random.getrandbits(1):
            await bench.shoot(("nadir", random.choice(SIDES)))
        assert await bench.read_edge("sun", memory, 4) == coordinates(x, y)


@timed_test
async def any_waveform(dut: Any) -> None:
    """Runs of any length, joined and left at any time, on both cameras."""
    bench = await PairTestbench.start(dut)
    for _ in range(12):
        for source in bench.cameras.values():
            for _ in range(3 * ROWS):
                source.send(line(random.randbytes(random.choice([COLUMNS] * 8 + [1, COLUMNS + 1]))))
                if random.random() < 1 / ROWS:
                    source.send(frame(b"")[: random.choice([GAP - 2, GAP, GAP + 9])])
        place = random.choice(bench.PLACES)
        await bench.store(place)
        await bench.acknowledged(place, 2 * GEOMETRY.pixels * bench.camera_of(place).period)
        await bench.mcu.standby()
    halves = await bench.check()
    assert any(half.pulses for half in halves.values())


@checked_test(PairTestbench)
async def lines_a_gap_apart(bench: PairTestbench) -> None:
    """As many low clocks as a gap may not have make no frame's end; one more does."""
    for place, pause in product(bench.PLACES, (GAP, GAP + 1)):
        source = bench.camera_of(place)
        await bench.store(place)
        source.send([*frame(b""), *flat(lines(picture(), pause))])
        await source.sent()
        assert await bench.acknowledged(place, 4 * source.period) == (pause == GAP)
        await bench.mcu.standby()
