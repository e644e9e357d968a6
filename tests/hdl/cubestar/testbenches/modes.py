"""ENABLE, RNW and everything else changing at any moment.

The SRAM's model fails a test in which board and SRAM drive the data bus together.
"""

import random
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, Timer

from cubestack.hdl.contract.bench.camera import flat, frame, lines, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from cubestack.hdl.contract.bench.watching import disturb_in_standby, levels
from tests.hdl.cubestar.board import PublishedTestbench

#: Idle times in ps, from a glitch to a few clocks.
MOMENTS = (1, 100, 3_000, 20_000, 100_000, 1_000_000)


async def works(bench: PublishedTestbench) -> None:
    """A frame is stored right, and comes back right. From any state, to standby."""
    await bench.standby()
    await bench.camera.sent()
    content = await bench.shoot(1)
    assert await bench.fetch(1) == content
    await bench.mcu.set(RNW=0)


async def meddle(bench: PublishedTestbench) -> None:
    """One change of the control pins at any moment, or a few data clocks."""
    after = random.randrange(1, 2 * random.choice(MOMENTS))
    mcu = bench.mcu
    level = random.getrandbits(1)
    match random.choice(["ENABLE", "ENABLE", "RNW", "both", "BANK", "DCLK"]):
        case "both":
            await mcu.set(after, ENABLE=level, RNW=random.getrandbits(1))
        case "DCLK":
            await mcu.read(random.randrange(1, 5))
        case pin:
            await mcu.set(after, **{pin: level})


@timed_test
async def controls_change_at_any_moment(dut: Any) -> None:
    bench = await PublishedTestbench.start(dut)
    for _ in range(4):
        for _ in range(12):
            bench.camera.send(random.choice([frame(picture()), flat(lines(picture()))]))
        for _ in range(150):
            await meddle(bench)
        await works(bench)
    assert len((await bench.check()).data) > 1


@checked_test(PublishedTestbench)
async def write_pulse_cut_off(bench: PublishedTestbench) -> None:
    """ENABLE falling or RNW rising in a write pulse ends it at once; the next frame is right.

    The bank stays, so that a late end of the pulse can not touch the other one.
    """
    for change in ({"ENABLE": 0}, {"RNW": 1}, {"ENABLE": 0, "RNW": 1}) * 3:
        bank = random.getrandbits(1)
        await bench.begin(bank, picture())
        for _ in range(random.randint(1, GEOMETRY.pixels)):
            await FallingEdge(bench.dut.SRAM_WE_N)
        await bench.mcu.set(random.randrange(1, bench.camera.period // 4), **change)
        await Timer(1, unit="step")
        assert levels(bench.dut, ("SRAM_WE_N", "SRAM_D_OE")) == {"SRAM_WE_N": 1, "SRAM_D_OE": 0}
        assert int(bench.dut.SRAM_A.value) // GEOMETRY.bank_size == bank
        assert bench.sram.pulses[-1].end == bench.mcu.controls[-1].time
        await works(bench)


@checked_test(PublishedTestbench)
async def pause_in_a_frame(bench: PublishedTestbench) -> None:
    """A glitch of either pin throws away what was stored; the next whole frame counts."""
    for away, back in (({"ENABLE": 0}, {"ENABLE": 1}), ({"RNW": 1}, {"RNW": 0})) * 3:
        await bench.store()
        first, second = frame(picture()), picture()
        start = await bench.camera.begin(first)
        await bench.camera.reach(start + len(first) - random.randrange(3, 2 * GEOMETRY.columns))
        await bench.mcu.set(random.randrange(1, bench.camera.period), **away)
        await bench.mcu.set(random.choice(MOMENTS[:4]), **back)
        await bench.camera.sent()
        assert not await bench.mcu.acknowledged(4 * bench.camera.period)
        bench.camera.send(frame(second))
        assert await bench.mcu.acknowledged()
        assert bench.stored() == second
        await bench.mcu.standby()


@timed_test
async def idle_is_reset(dut: Any) -> None:
    """While ENABLE is low nothing on any other pin moves any output, not even for a glitch."""
    bench = await PublishedTestbench.without_camera(dut)
    pins = ("PIXCLK", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC", "RNW", "BANK", "DCLK", "SRAM_D_I")
    await disturb_in_standby(dut, (*bench.standby_levels(), "SRAM_A"), pins, MOMENTS[:5], 1000)
    dut.PIXCLK.value = dut.DCLK.value = 0
    await bench.mcu.set(RNW=0, BANK=0)
    cocotb.start_soon(bench.camera.run())
    await works(bench)
    await bench.check()


@checked_test(PublishedTestbench)
async def standby_is_reset_from_any_state(bench: PublishedTestbench) -> None:
    """However it was left, each output is back at its reset value the moment ENABLE is low."""
    for _ in range(20):
        bench.camera.send(frame(picture()))
        for _ in range(random.randint(1, 6)):
            await meddle(bench)
        await bench.mcu.standby()
        await Timer(1, unit="step")
        bench.in_standby()
    await works(bench)
