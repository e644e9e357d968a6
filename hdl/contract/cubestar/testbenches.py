"""Tests of CubeStar's contract with a camera, an SRAM and a processor in Python."""

import random
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import flat, line, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import ODD, wait
from cubestack.hdl.contract.cubestar.bench import IMAGE, LATENCY, ContractBench, pause, rows_of
from cubestack.hdl.contract.cubestar.points import hit
from cubestack.hdl.contract.testing import contract_test

COLUMNS, ROWS = GEOMETRY
BANKS = (0, 1)

#: So much of an image, never a whole one.
PART = min(GEOMETRY.pixels - 1, 2 * COLUMNS + 5)


@contract_test()
async def stores_and_reads_back(dut: Any) -> None:
    bench = await ContractBench.start(dut)
    for bank in (0, 1, 1, 0):
        other = bench.stored(1 - bank)
        await bench.shoot(bank)
        assert bench.stored(1 - bank) == other, "the other bank has changed"
        await bench.read_back(bank)
        hit("image", bank=bank, done="stored")
        hit("image", bank=bank, done="read")
    await bench.check()


@contract_test()
async def acknowledges_only_whole_frames(dut: Any) -> None:
    """Joined at any row, or cut short by VSYNC; the next frame is stored in its place."""
    bench = await ContractBench.start(dut)
    for row in (0, *range(ROWS - 1), ROWS - 1):
        first = rows_of(picture())
        await bench.camera.begin([*pause(), *flat(first)])
        start = len(bench.camera.clocks) + 20 + row * (COLUMNS + 12)
        await bench.camera.reach(start)
        await bench.command(0)
        await bench.is_dropped()
        bench.camera.send(bench.frame(picture()))
        await bench.is_stored(0)
        hit("border", case="joined in a frame")
    for row in range(ROWS - 1):
        await bench.store(1)
        bench.camera.send([*pause(), *flat(rows_of(picture())[: row + 1])])
        bench.camera.send(bench.frame(picture()))
        await bench.is_stored(1)
        hit("border", case="frame too short")
    await bench.check()


@contract_test()
async def last_row_too_short(dut: Any) -> None:
    bench = await ContractBench.start(dut)
    for cut in {1, COLUMNS // 2, COLUMNS - 1}:
        await bench.store(0)
        bench.camera.send([*pause(), *flat(rows_of(picture()[:-cut]))])
        await bench.is_dropped()
        bench.camera.send(bench.frame(picture()))
        await bench.is_stored(0)
        hit("border", case="last row too short")
    await bench.check()


@contract_test()
async def surplus_pixels_are_not_stored(dut: Any) -> None:
    """Rows that are too long, more rows than an image has, and frames after ACK."""
    bench = await ContractBench.start(dut)
    for surplus in (1, 2, COLUMNS):
        content = picture()
        await bench.store(0)
        rows = [content[n : n + COLUMNS] for n in range(0, len(content), COLUMNS)]
        bench.whole.append(content)
        bench.camera.send(pause())
        for row in [*rows, random.randbytes(COLUMNS)]:
            bench.camera.send(line(row + random.randbytes(surplus), random.randint(8, 16)))
        bench.camera.send([*pause(), *flat(rows_of(picture()))])
        await bench.camera.sent()
        assert int(dut.ACK.value), "no ACK, or it has fallen"
        assert IMAGE.holds(bench.stored(0), content), "the memory changed after ACK"
        await bench.standby()
        hit("border", case="row too long")
        hit("border", case="rows after ACK")
    await bench.check()


@contract_test()
async def aborted_at_any_moment(dut: Any) -> None:
    """By ENABLE or RNW, while a frame is sent; a design that was aborted works."""
    bench = await ContractBench.start(dut)
    for number in range(12):
        place = random.getrandbits(1)
        await bench.begin(place, picture())
        await wait(random.randrange((GEOMETRY.pixels + 20 * ROWS) * bench.camera.period), ODD)
        left_by = ("ENABLE", "RNW")[number % 2]
        state = "acknowledged" if int(dut.ACK.value) else "storing"
        await bench.mcu.set(random.randrange(1, 2_000), **{left_by: int(left_by == "RNW")})
        await Timer(LATENCY * bench.camera.period, unit="step")
        assert not int(dut.ACK.value), f"ACK stays high after {left_by} has changed"
        hit("abort", left_in=state, left_by=left_by)
        await bench.works()
    for left_by in ("ENABLE", "RNW"):
        await bench.begin(0, picture())
        assert await bench.mcu.acknowledged(bench.patience(0)), "no ACK"
        await bench.mcu.set(**{left_by: int(left_by == "RNW")})
        await Timer(LATENCY * bench.camera.period, unit="step")
        assert not int(dut.ACK.value), f"ACK stays high after {left_by} has changed"
        hit("abort", left_in="acknowledged", left_by=left_by)
        await bench.standby()
    await bench.works()
    await bench.check()


@contract_test()
async def aborted_early(dut: Any) -> None:
    """In the first rows of a frame, repeatedly; no write outside of the image follows."""
    bench = await ContractBench.start(dut)
    for left_by in ("ENABLE", "RNW") * 3:
        await bench.begin(random.getrandbits(1), picture()[:PART])
        bench.whole.clear()
        await wait(random.randrange((PART + 40) * bench.camera.period), ODD)
        await bench.mcu.set(random.randrange(1, 2_000), **{left_by: int(left_by == "RNW")})
        hit("abort", left_in="storing", left_by=left_by)
        await Timer(LATENCY * bench.camera.period, unit="step")
        assert not int(dut.ACK.value), "ACK without an image"
        await bench.standby()
        await bench.camera.sent()
    await bench.check()


@contract_test()
async def outputs_rest_in_standby(dut: Any) -> None:
    """Whatever the camera sends, no pin moves."""
    bench = await ContractBench.start(dut)
    pins = ("ACK", "DATA", "SRAM_A", "SRAM_D_OE", "SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N")
    watching = [cocotb.start_soon(_rests(dut, name)) for name in pins]
    bench.camera.send([*pause(), *flat(rows_of(picture()[:PART])), *pause()])
    await bench.camera.sent()
    for task in watching:
        task.cancel()
    for name in ("RNW", "BANK"):
        for level in (1, 0):
            await bench.mcu.set(**{name: level})
            await Timer(LATENCY * bench.camera.period, unit="step")
            bench.in_standby()
        hit("standby", changes=name)
    hit("standby", changes="camera")
    await bench.check()


async def _rests(dut: Any, name: str) -> None:
    await getattr(dut, name).value_change
    raise AssertionError(f"{name} moves in standby")


@contract_test()
async def reads_without_a_camera(dut: Any) -> None:
    """The pixel clock stands still, low or high, since power-up."""
    bench = await ContractBench.start(dut, camera=False)
    for bank in BANKS:
        for level in (0, 1):
            dut.PIXCLK.value = level
            await bench.read_back(bank, PART)
        hit("read", bank=bank, camera="stopped")
    await bench.check()


@contract_test()
async def writes_nothing_while_reading(dut: Any) -> None:
    """The camera goes on to send frames."""
    bench = await ContractBench.start(dut)
    before = bytes(bench.sram.memory)
    for bank in BANKS:
        bench.camera.send([*pause(), *flat(rows_of(picture()[:PART])), *pause()])
        await bench.read_back(bank, PART)
        await bench.camera.sent()
        assert bench.sram.memory == before, "the memory changed while it was read"
        hit("read", bank=bank, camera="runs")
    await bench.check()


@contract_test()
async def bank_is_latched(dut: Any) -> None:
    """By the rising ENABLE: BANK may change while the design stores or reads."""
    bench = await ContractBench.start(dut)
    for bank in BANKS:
        await bench.store(bank)
        await bench.mcu.set(BANK=1 - bank)
        content = picture()
        bench.camera.send([*pause(), *flat(rows_of(content[:PART]))])
        await bench.camera.sent()
        await bench.standby()
        wrong = f"not stored in bank {bank}, which BANK was when ENABLE rose"
        assert IMAGE.holds(bench.stored(bank)[:COLUMNS], content), wrong
        await bench.mcu.open(bank)
        await bench.mcu.set(BANK=1 - bank)
        expected = IMAGE.presented(bench.stored(bank))[:PART]
        assert await bench.mcu.read(PART) == expected, f"not read from bank {bank}"
        await bench.standby()
        hit("bank", bank=bank)
    await bench.check()
