"""Boards on the processor's external bus: who has each memory, and neither disturbs the other."""

import random

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.testbench import checked_test
from cubestack.hdl.contract.bench.timing import ODD, SLOWEST_ACCESS, wait
from cubestack.hdl.contract.bench.watching import levels
from tests.hdl.cubestar.next_version import MEMORY, BusTestbench
from tests.hdl.harness.any_top import TESTBENCH


async def works_on(bench: BusTestbench, accesses: int, *memories: int) -> None:
    """Reads and writes in any order against an array, in some memories or in all."""
    expected = {id(sram): bytearray(sram.memory) for sram in bench.srams}
    for _ in range(accesses):
        sram, position, address, select = bench.any_spot(*memories)
        content = expected[id(sram)]
        if random.getrandbits(1):
            content[position] = random.getrandbits(8)
            await bench.bus.write(address, content[position], select)
        else:
            assert await bench.bus.read(address, select) == content[position]
    for sram in (bench.srams[n] for n in memories or range(len(bench.srams))):
        assert sram.memory == expected[id(sram)]


async def is_cut_off(bench: BusTestbench, accesses: int, *memories: int) -> None:
    """Accesses to some memories or to all have no effect, and nothing answers."""
    for _ in range(accesses):
        _, _, address, select = bench.any_spot(*memories)
        if random.getrandbits(1):
            await bench.bus.write(address, random.getrandbits(8), select)
        else:
            assert await bench.bus.read(address, select) is None


@checked_test(TESTBENCH)
async def bus_has_all_memories(bench: TESTBENCH) -> None:
    """Each access reaches the memory that is meant, and no other."""
    await bench.open_all()
    await works_on(bench, 300)


@checked_test(TESTBENCH)
async def picture_is_worked_on_where_it_was_stored(bench: TESTBENCH) -> None:
    for place in (*bench.PLACES, bench.PLACES[0]):
        content = await bench.shoot(place)
        assert await bench.fetch(place) == content
        await bench.open(place)
        window, (_, bank) = bench.window(place), bench.memory_of(place)
        spot = {"address": window.base + bank * MEMORY, "select": window.select}
        await bench.bus.write(value=content[0] ^ 0xFF, **spot)
        assert await bench.bus.read(**spot) == content[0] ^ 0xFF
        await bench.standby()


@checked_test(TESTBENCH)
async def memory_that_is_filled_is_out_of_reach(bench: TESTBENCH) -> None:
    """However long the accesses go on; what else it holds stays."""
    for place in (*bench.PLACES, *bench.PLACES):
        sram, bank = bench.memory_of(place)
        other = sram.picture(1 - bank)
        content = picture()
        await bench.begin(place, content)
        meddling = cocotb.start_soon(is_cut_off(bench, 1 << 30, bench.srams.index(sram)))
        assert await bench.acknowledged(place)
        meddling.cancel()
        for name in (*bench.SELECTS, "RE_N", "WE_N"):
            getattr(bench.dut, name).value = 1
        bench.bus.drives = True
        await bench.standby()
        assert (sram.picture(bank), sram.picture(1 - bank)) == (content, other)


@checked_test(TESTBENCH)
async def one_is_filled_while_the_other_is_worked_on(bench: TESTBENCH) -> None:
    """In turn; of a board with one memory there is no other."""
    if len(bench.srams) == 1:
        return
    for filled in (0, 1, 0, 1, random.getrandbits(1)):
        content = picture()
        await bench.begin(filled, content)
        if len(bench.mcus) > 1:
            await bench.open(1 - filled)
        await works_on(bench, 60, 1 - filled)
        assert await bench.acknowledged(filled)
        await bench.standby()
        assert bench.stored(filled) == content


@checked_test(TESTBENCH)
async def standby_answers_nothing(bench: TESTBENCH) -> None:
    before = [bytes(sram.memory) for sram in bench.srams]
    await is_cut_off(bench, 60)
    assert [sram.memory for sram in bench.srams] == before


@checked_test(TESTBENCH)
async def strobes_together_read(bench: TESTBENCH) -> None:
    """A processor never does that; FPGA and SRAM must not fight over it."""
    before = [bytes(sram.memory) for sram in bench.srams]
    await bench.open_all()
    for _ in range(4):
        sram, position, address, select = bench.any_spot()
        assert await bench.bus.read_and_write(address, select) == sram.memory[position]
    assert [sram.memory for sram in bench.srams] == before
    assert not any(sram.edges for sram in bench.srams)


@checked_test(TESTBENCH)
async def nothing_happens_without_the_chip_select(bench: TESTBENCH) -> None:
    """No memory is selected or written, and the bus is not driven."""
    await bench.open_all()
    before = [bytes(sram.memory) for sram in bench.srams]
    for strobe in ["RE_N", "WE_N"] * 8:
        await bench.bus.address(random.randrange(2 * MEMORY))
        bench.dut.AD_LOW_I.value = random.getrandbits(8)
        getattr(bench.dut, strobe).value = 0
        await wait(SLOWEST_ACCESS, ODD)
        high = [m + name for m in bench.MEMORIES for name in ("CE_N", "OE_N", "WE_N")]
        rest = {"AD_LOW_OE": 0, **dict.fromkeys(high, 1)}
        assert levels(bench.dut, rest) == rest
        getattr(bench.dut, strobe).value = 1
        await Timer(1, unit="ns")
    assert [sram.memory for sram in bench.srams] == before
