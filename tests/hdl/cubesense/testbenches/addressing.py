"""Address control from the microcontroller; nothing is stored, so any size of picture is quick."""

import random
from collections.abc import AsyncIterator
from typing import Any

from cocotb.triggers import Timer
from cocotb.types import LogicArray

from cubestack.firmware_model.interface.cubesense.fpga import ADDRESS_BYTES, address_bytes
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from cubestack.hdl.contract.bench.timing import ODD, wait
from cubestack.hdl.contract.bench.watching import levels
from tests.hdl.cubesense.pair import OTHER, PREFIXES, PairTestbench, enables
from tests.hdl.cubesense.reference import READ_OUT, SIDES

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows
CORNERS = [(x, y) for x in (0, COLUMNS - 1) for y in (0, ROWS - 1)]


def any_pixel() -> tuple[int, int]:
    return random.randrange(COLUMNS), random.randrange(ROWS)


async def each_side(bench: PairTestbench) -> AsyncIterator[str]:
    for side in SIDES:
        await bench.mcu.open_address(side)
        yield side
        await bench.mcu.standby()


async def take(bench: PairTestbench, x: int, y: int) -> None:
    await bench.mcu.take(address_bytes(x, y, READ_OUT))


def byte_at(bench: PairTestbench, side: str, x: int, y: int) -> int:
    return bench.srams[side].memory[GEOMETRY.address(x, y)]


@checked_test(PairTestbench)
async def pixels_in_any_order(bench: PairTestbench) -> None:
    async for side in each_side(bench):
        for x, y in [*CORNERS, *(any_pixel() for _ in range(30))]:
            await take(bench, x, y)
            assert await bench.mcu.clock() == byte_at(bench, side, x, y)


@checked_test(PairTestbench)
async def goes_on_row_by_row(bench: PairTestbench) -> None:
    """Past the end of a row comes the next one, past the last pixel the first one."""
    for x, y in [*CORNERS, *(any_pixel() for _ in range(5))]:
        side = random.choice(SIDES)
        await bench.mcu.open_address(side)
        await take(bench, x, y)
        start = y * COLUMNS + x
        stored = bench.content(side)
        assert await bench.mcu.read(9) == (stored + stored)[start : start + 9]
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def addresses_outside_of_the_picture(bench: PairTestbench) -> None:
    """Any address of the memory can be looked at; bits beyond it are ignored."""
    side = random.choice(SIDES)
    await bench.mcu.open_address(side)
    for _ in range(20):
        address = random.getrandbits(8 * ADDRESS_BYTES)
        await bench.mcu.take(address.to_bytes(ADDRESS_BYTES, "big"))
        assert await bench.mcu.clock() == bench.srams[side].memory[address % GEOMETRY.bank_size]


@checked_test(PairTestbench)
async def standby_and_any_other_row_forget_the_address(bench: PairTestbench) -> None:
    async for side in each_side(bench):
        await take(bench, COLUMNS - 1, ROWS - 1)
        await bench.mcu.standby()
        await bench.mcu.command(1, 1, 0, *enables(side))
        assert await bench.mcu.read(2) == bench.content(side)[:2]
        await take(bench, 2, 1)
        await bench.mcu.standby()
        await bench.mcu.read_picture(side)
        assert await bench.mcu.read(2) == bench.content(side)[:2]


@timed_test
async def shift_keeps_the_address(dut: Any) -> None:
    """However often it moves; unknown stands for a glitch. No SRAM is there to see it."""
    bench = PairTestbench(dut)
    async for side in each_side(bench):
        address = getattr(dut, f"{PREFIXES[side]}_SRAM_A")
        x, y = any_pixel()
        await take(bench, x, y)
        for level in ("X", 0, "X", 1, 0, "X"):
            dut.SHIFT.value = LogicArray("X") if level == "X" else level
            await Timer(1, unit="ns")
            assert int(address.value) == GEOMETRY.address(x, y)
        dut.SHIFT.value = 1


@checked_test(PairTestbench)
async def address_is_used_after_shift_moved(bench: PairTestbench) -> None:
    async for side in each_side(bench):
        x, y = any_pixel()
        await take(bench, x, y)
        for _ in range(9):
            await bench.mcu.set(SHIFT=0)
            await bench.mcu.set(SHIFT=1)
        assert await bench.mcu.clock() == byte_at(bench, side, x, y)


@timed_test
async def memory_is_off_while_an_address_is_taken(dut: Any) -> None:
    bench = await PairTestbench.start(dut)
    async for side in each_side(bench):
        quiet = {"DATA_OE": 0} | {f"{PREFIXES[side]}_SRAM_{name}": 1 for name in ("CE_N", "OE_N")}
        for byte in random.randbytes(7):
            bench.mcu.drive(byte)
            await bench.mcu.clock()
            assert levels(dut, quiet) == quiet
        bench.mcu.drive(None)


@checked_test(PairTestbench)
async def the_other_enable_ends_it(bench: PairTestbench) -> None:
    """Both enables low are rows of the link, which need no address."""
    async for side in each_side(bench):
        other = f"{PREFIXES[OTHER[side]]}EN"
        await take(bench, *any_pixel())
        await bench.mcu.set(SHIFT=0)
        await bench.mcu.set(**{other: 0})
        await wait(1_000, ODD)
        off = {"DATA_OE": 0, f"{PREFIXES[side]}_SRAM_A": 0}
        assert levels(bench.dut, off) == off
        await bench.mcu.set(**{other: 1})
        await bench.mcu.set(SHIFT=1)
        assert await bench.mcu.read(1) == bench.content(side)[:1]
