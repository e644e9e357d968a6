"""Reading the stored bytes with the microcontroller's clock, and choosing the bank."""

import random
from itertools import product
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge

from cubestack.hdl.contract.bench.camera import frame, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from cubestack.hdl.contract.bench.timing import ODD, wait
from tests.hdl.coverage.cubestar import STOPPED
from tests.hdl.cubestar.board import PublishedTestbench


@timed_test
async def without_a_camera(dut: Any) -> None:
    """No pixel clock since power-up; storing waits, reading works."""
    bench = await PublishedTestbench.without_camera(dut)
    await bench.mcu.store()
    assert not await bench.mcu.acknowledged(10**6)
    await bench.mcu.standby()
    await bench.mcu.open(bank=1)
    assert await bench.mcu.read(GEOMETRY.pixels) == bench.stored(1)
    await bench.check()


@checked_test(PublishedTestbench)
async def camera_dies_while_storing(bench: PublishedTestbench) -> None:
    """At any level of its clock, in a write pulse too; with ENABLE held or not."""
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
        read = await bench.mcu.read(random.randrange(1, 10))
        assert bench.stored().startswith(read)
        await bench.mcu.set(ENABLE=0, RNW=0)
        bench.camera.go()
        await bench.camera.sent()


@checked_test(PublishedTestbench)
async def both_banks(bench: PublishedTestbench) -> None:
    """BANK counts when ENABLE rises only; the other bank's picture is left alone."""
    content = {bank: bench.stored(bank) for bank in (0, 1)}
    for _ in range(6):
        bank = random.getrandbits(1)
        content[bank] = picture()
        await bench.begin(bank, content[bank])
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


@checked_test(PublishedTestbench)
async def left_after_any_count_by_any_pin(bench: PublishedTestbench) -> None:
    """The next reading starts at the first pixel all the same, also without standby between."""
    pixels, columns = GEOMETRY.pixels, GEOMETRY.columns
    further, beyond = random.randrange(columns, pixels), 2 * pixels + random.randrange(pixels)
    counts = (0, random.randrange(1, columns), further, pixels, beyond)
    for count, end in product(counts, ({"ENABLE": 0}, {"RNW": 0}, {"ENABLE": 0, "RNW": 0})):
        bank = random.getrandbits(1)
        content = bench.stored(bank)
        await bench.mcu.open(bank)
        assert await bench.mcu.read(count) == (3 * content)[:count]
        await bench.mcu.set(**end)
        if end == {"RNW": 0}:
            await bench.mcu.set(RNW=1)
            assert await bench.mcu.read(3) == content[:3]
        await bench.mcu.set(ENABLE=0)


@timed_test
async def every_command_without_a_clock(dut: Any) -> None:
    """The camera's never ran, or stopped long ago at either level."""
    bench = await PublishedTestbench.without_camera(dut)
    await every_command(bench)
    await wait(2 * STOPPED * bench.camera.period, ODD)  # its first clock is no late one
    cocotb.start_soon(bench.camera.run())
    await bench.camera.reach(3)
    for edge in (RisingEdge, FallingEdge):
        await stop(bench, edge)
        await every_command(bench)
        bench.camera.go()
        await bench.camera.reach(len(bench.camera.clocks) + 3)
    await bench.check()


async def stop(bench: PublishedTestbench, edge: Any) -> None:
    """The camera's clock stops after an edge, for longer than any stall."""
    await edge(bench.dut.PIXCLK)
    await bench.mcu.set(after=1)
    bench.camera.stop()
    await wait(2 * STOPPED * bench.camera.period, ODD)


async def every_command(bench: PublishedTestbench) -> None:
    """In either bank; from standby to standby."""
    for bank in (0, 1):
        await bench.mcu.set(BANK=bank, RNW=0)
        await bench.mcu.set(ENABLE=1)
        assert not await bench.mcu.acknowledged(10**6)
        await bench.mcu.standby()
        await bench.mcu.open(bank)
        assert await bench.mcu.read(3) == bench.stored(bank)[:3]
        await bench.mcu.standby()


@checked_test(PublishedTestbench)
async def clock_stops_while_storing(bench: PublishedTestbench) -> None:
    """At either level, in a picture that is given up and in one that goes on to ACK."""
    for edge, goes_on in product((RisingEdge, FallingEdge), (True, False)):
        content = picture()
        await bench.store()
        start = await bench.camera.begin(frame(content))
        await bench.camera.reach(start + random.randrange(4, GEOMETRY.pixels))
        await stop(bench, edge)
        if goes_on:
            bench.camera.go()
            assert await bench.acknowledged(0)
            assert bench.stored() == content
        await bench.mcu.standby()
        bench.camera.go()
        await bench.camera.sent()
