"""Address control from the microcontroller; nothing is stored, so any size of picture is quick."""

import random
from typing import Any

from cocotb.triggers import Timer
from cocotb.types import LogicArray

from cubestack.firmware_model.interface.cubesense.fpga import ADDRESS_BYTES, address_bytes
from tests.hdl.cubesense.pair import OTHER, PREFIXES, PairTestbench
from tests.hdl.cubesense.reference import SIDES
from tests.hdl.cubesense.settings import READ_OUT
from tests.hdl.harness.geometry import GEOMETRY
from tests.hdl.harness.instants import ODD, wait
from tests.hdl.harness.testbench import checked_test, timed_test

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows
CORNERS = [(x, y) for x in (0, COLUMNS - 1) for y in (0, ROWS - 1)]


def any_pixel() -> tuple[int, int]:
    return random.randrange(COLUMNS), random.randrange(ROWS)


def byte_at(bench: PairTestbench, side: str, x: int, y: int) -> int:
    return bench.srams[side].memory[GEOMETRY.address(x, y)]


@checked_test(PairTestbench)
async def pixels_in_any_order(bench: PairTestbench) -> None:
    """The first clock presents the addressed byte, in either memory."""
    for side in SIDES:
        await bench.mcu.open_address(side)
        for x, y in [*CORNERS, *(any_pixel() for _ in range(30))]:
            await bench.mcu.take(address_bytes(x, y, READ_OUT))
            assert await bench.mcu.clock() == byte_at(bench, side, x, y)
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def goes_on_row_by_row(bench: PairTestbench) -> None:
    """Past the end of a row comes the next one, past the last pixel the first one."""
    for x, y in [*CORNERS, *(any_pixel() for _ in range(5))]:
        side = random.choice(SIDES)
        await bench.mcu.open_address(side)
        await bench.mcu.take(address_bytes(x, y, READ_OUT))
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
        wanted = bench.srams[side].memory[address % GEOMETRY.bank_size]
        assert await bench.mcu.clock() == wanted


@checked_test(PairTestbench)
async def standby_and_any_other_row_forget_the_address(bench: PairTestbench) -> None:
    for side in SIDES:
        await bench.mcu.open_address(side)
        await bench.mcu.take(address_bytes(COLUMNS - 1, ROWS - 1, READ_OUT))
        await bench.mcu.standby()
        await bench.mcu.command(1, 1, 0, *((0, 1) if side == "sun" else (1, 0)))
        assert await bench.mcu.read(2) == bench.content(side)[:2]
        await bench.mcu.take(address_bytes(2, 1, READ_OUT))
        await bench.mcu.standby()
        await bench.mcu.read_picture(side)
        assert await bench.mcu.read(2) == bench.content(side)[:2]
        await bench.mcu.standby()


@timed_test
async def shift_keeps_the_address(dut: Any) -> None:
    """However often it moves; unknown stands for a glitch. No SRAM is there to see it."""
    bench = PairTestbench(dut)
    for side in SIDES:
        address = getattr(dut, f"{PREFIXES[side]}_SRAM_A")
        x, y = any_pixel()
        await bench.mcu.open_address(side)
        await bench.mcu.take(address_bytes(x, y, READ_OUT))
        for level in ("X", 0, "X", 1, 0, "X"):
            dut.SHIFT.value = LogicArray("X") if level == "X" else level
            await Timer(1, unit="ns")
            assert int(address.value) == GEOMETRY.address(x, y)
        dut.SHIFT.value = 1
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def address_is_used_after_shift_moved(bench: PairTestbench) -> None:
    for side in SIDES:
        x, y = any_pixel()
        await bench.mcu.open_address(side)
        await bench.mcu.take(address_bytes(x, y, READ_OUT))
        for _ in range(9):
            await bench.mcu.set(SHIFT=0)
            await bench.mcu.set(SHIFT=1)
        assert await bench.mcu.clock() == byte_at(bench, side, x, y)
        await bench.mcu.standby()


@timed_test
async def memory_is_off_while_an_address_is_taken(dut: Any) -> None:
    bench = await PairTestbench.start(dut)
    for side in SIDES:
        prefix = PREFIXES[side]
        await bench.mcu.open_address(side)
        for byte in random.randbytes(7):
            bench.mcu.drive(byte)
            await bench.mcu.clock()
            assert not int(dut.DATA_OE.value)
            assert int(getattr(dut, f"{prefix}_SRAM_CE_N").value)
            assert int(getattr(dut, f"{prefix}_SRAM_OE_N").value)
        bench.mcu.drive(None)
        await bench.mcu.standby()


@checked_test(PairTestbench)
async def the_other_enable_ends_it(bench: PairTestbench) -> None:
    """Both enables low are rows of the link, which need no address."""
    for side in SIDES:
        other = f"{PREFIXES[OTHER[side]]}EN"
        await bench.mcu.open_address(side)
        await bench.mcu.take(address_bytes(*any_pixel(), READ_OUT))
        await bench.mcu.set(SHIFT=0)
        await bench.mcu.set(**{other: 0})
        await wait(1_000, ODD)
        assert not int(bench.dut.DATA_OE.value)
        assert int(getattr(bench.dut, f"{PREFIXES[side]}_SRAM_A").value) == 0
        await bench.mcu.set(**{other: 1})
        await bench.mcu.set(SHIFT=1)
        assert await bench.mcu.read(1) == bench.content(side)[:1]
        await bench.mcu.standby()
