"""Two SRAMs in turn: the camera fills one while the bus has the other."""

import random
from typing import Any

from bench import picture, timed_test
from bench_next import DoubleBench
from geometry import GEOMETRY

MEMORY = GEOMETRY.bank_size  # distance of the two memories on the bus


async def begin(bench: DoubleBench, into: int) -> bytes:
    """Storing begins; the picture that comes."""
    content = picture()
    await bench.begin(into, content)
    return content


async def works_on(bench: DoubleBench, memory: int, accesses: int) -> None:
    """Reads and writes in a memory, against an array."""
    expected = bytearray(bench.srams[memory].memory)
    for _ in range(accesses):
        position = random.randrange(MEMORY)
        address = memory * MEMORY + position
        if random.getrandbits(1):
            expected[position] = random.getrandbits(8)
            await bench.bus.write(address, expected[position])
        else:
            assert await bench.bus.read(address) == expected[position]
    assert bench.srams[memory].memory == expected


@timed_test
async def bus_has_both_memories(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    expected = [bytearray(sram.memory) for sram in bench.srams]
    for _ in range(300):
        memory, position = random.getrandbits(1), random.randrange(MEMORY)
        if random.getrandbits(1):
            expected[memory][position] = random.getrandbits(8)
            await bench.bus.write(memory * MEMORY + position, expected[memory][position])
        else:
            byte = await bench.bus.read(memory * MEMORY + position)
            assert byte == expected[memory][position]
    assert [sram.memory for sram in bench.srams] == expected
    assert all(sram.edges == len(sram.pulses) for sram in bench.srams)
    await bench.check()


@timed_test
async def one_is_filled_while_the_other_is_worked_on(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    for into in (0, 1, 0, 1, random.getrandbits(1)):
        content = await begin(bench, into)
        await works_on(bench, 1 - into, 60)
        await bench.finish(into, content)
    await bench.check()


@timed_test
async def memory_that_is_filled_is_out_of_reach(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    for into in (0, 1):
        content = await begin(bench, into)
        for _ in range(30):
            address = into * MEMORY + random.randrange(MEMORY)
            if random.getrandbits(1):
                await bench.bus.write(address, random.getrandbits(8))
            else:
                assert await bench.bus.read(address) is None
        await bench.finish(into, content)
    await bench.check()


@timed_test
async def one_memory_serves_both_in_turn(dut: Any) -> None:
    """The other one has failed: it is not stored in, not asked, and never selected."""
    bench = await DoubleBench.start(dut)
    good = random.getrandbits(1)
    failed = getattr(dut, f"SRAM{2 - good}_CE_N")
    for _ in range(3):
        await bench.finish(good, await begin(bench, good))
        await works_on(bench, good, 20)
        assert int(failed.value)
    await bench.check()


@timed_test
async def standby_turns_all_off(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    await begin(bench, random.getrandbits(1))
    await bench.camera.reach(len(bench.camera.clocks) + random.randrange(20))
    await bench.check()
    await bench.open()
    await bench.finish(1, await begin(bench, 1))
    await bench.check()


@timed_test
async def standby_answers_nothing(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    await bench.standby()
    before = [bytes(sram.memory) for sram in bench.srams]
    for _ in range(40):
        address = random.randrange(2 * MEMORY)
        if random.getrandbits(1):
            await bench.bus.write(address, random.getrandbits(8))
        else:
            assert await bench.bus.read(address) is None
    assert [sram.memory for sram in bench.srams] == before
    await bench.check()


@timed_test
async def strobes_together_read(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    before = [bytes(sram.memory) for sram in bench.srams]
    for _ in range(4):
        memory, position = random.getrandbits(1), random.randrange(MEMORY)
        byte = await bench.bus.read_and_write(memory * MEMORY + position)
        assert byte == before[memory][position]
    assert [sram.memory for sram in bench.srams] == before
    assert not any(sram.edges for sram in bench.srams)
    await bench.check()
