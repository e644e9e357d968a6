"""Reading the stored bytes with the microcontroller's clock, and choosing the bank."""

import random
from typing import Any

from bench import Bench, frame, picture, timed_test
from geometry import GEOMETRY


def wrapped(content: bytes, count: int) -> bytes:
    """The first ``count`` bytes of ``content`` without end."""
    return (content * (count // len(content) + 1))[:count]


@timed_test
async def starts_at_the_first_pixel(dut: Any) -> None:
    """However far the last reading came, and whichever pin ended it."""
    bench = await Bench.start(dut)
    for end in ({"ENABLE": 0}, {"RNW": 0}, {"ENABLE": 0, "RNW": 0}, {"ENABLE": 0}):
        await bench.mcu.open()
        count = random.choice([1, GEOMETRY.columns, random.randrange(GEOMETRY.pixels)])
        assert await bench.mcu.read(count) == bench.stored()[:count]
        await bench.mcu.set(**end)
        if end == {"RNW": 0}:
            await bench.mcu.set(RNW=1)
            assert await bench.mcu.read(3) == bench.stored()[:3]
            await bench.mcu.standby()
    await bench.check()


@timed_test
async def wraps_past_the_last_pixel(dut: Any) -> None:
    bench = await Bench.start(dut)
    await bench.mcu.open()
    count = 2 * GEOMETRY.pixels + random.randrange(GEOMETRY.pixels)
    assert await bench.mcu.read(count) == wrapped(bench.stored(), count)
    await bench.check()


@timed_test
async def without_a_camera(dut: Any) -> None:
    """No pixel clock since power-up; storing waits, reading works."""
    bench = await Bench.start(dut, camera=False)
    await bench.mcu.store()
    assert not await bench.mcu.acknowledged(10**6)
    await bench.mcu.standby()
    await bench.mcu.open(bank=1)
    assert await bench.mcu.read(GEOMETRY.pixels) == bench.stored(1)
    await bench.check()


@timed_test
async def camera_dies_while_storing(dut: Any) -> None:
    """At any level of its clock, in a write pulse too; with ENABLE held or not."""
    bench = await Bench.start(dut)
    for _ in range(8):
        await bench.store()
        start = await bench.camera.begin(frame(picture()))
        await bench.camera.reach(start + random.randrange(4, GEOMETRY.pixels))
        await bench.mcu.set(after=random.randrange(bench.camera.period))
        bench.camera.stop()
        if random.getrandbits(1):
            await bench.mcu.standby()
            await bench.mcu.open()
        else:
            await bench.mcu.set(RNW=1)
        count = random.randrange(1, 10)
        read = await bench.mcu.read(count)
        assert read == bench.stored()[:count]
        await bench.mcu.set(ENABLE=0, RNW=0)
        bench.camera.go()
        await bench.camera.sent()
    await bench.check()


@timed_test
async def both_banks(dut: Any) -> None:
    """BANK counts when ENABLE rises only; the other bank's picture is left alone."""
    bench = await Bench.start(dut)
    content = {bank: bench.stored(bank) for bank in (0, 1)}
    for _ in range(6):
        bank = random.getrandbits(1)
        content[bank] = picture()
        await bench.store(bank)
        bench.camera.send(frame(content[bank]))
        while bench.camera.busy:
            await bench.mcu.set(BANK=random.getrandbits(1))
        assert await bench.mcu.acknowledged(4 * bench.camera.period)
        await bench.mcu.standby()
        assert [bench.stored(0), bench.stored(1)] == [content[0], content[1]]
        bank = random.getrandbits(1)
        await bench.mcu.open(bank)
        for expected in content[bank]:
            await bench.mcu.set(BANK=random.getrandbits(1))
            assert await bench.mcu.clock() == expected
        await bench.mcu.set(ENABLE=0, RNW=0)
    await bench.check()


@timed_test
async def byte_stands_until_the_next_clock(dut: Any) -> None:
    """DATA keeps still between rising edges, whatever the memory offers meanwhile."""
    bench = await Bench.start(dut)
    await bench.mcu.open()
    for expected in bench.stored():
        assert await bench.mcu.clock() == expected
        await bench.mcu.set(after=random.randrange(200_000))
        assert int(dut.DATA.value) == expected
    await bench.check()
