"""Two SRAMs in turn: the camera fills one while the bus has the other."""

import random
from typing import Any

import cocotb
from bench import Camera, frame, picture, timed_test
from cocotb.triggers import ReadOnly, Timer
from ebi import Ebi, sram_at, stored
from geometry import GEOMETRY
from instants import ODD, wait

MEMORY = GEOMETRY.bank_size  # distance of the two memories on the bus
SRAMS = (1, 2)


class DoubleBench:
    """Camera, processor and both SRAMs around the board."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        for name in ("ENABLE", "RNW", "INTO", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut)
        self.bus = Ebi(dut)
        self.into: int | None = None  # memory that is stored in
        self.srams = [sram_at(dut, f"SRAM{n}_", lambda n=n: self.into == n - 1) for n in SRAMS]

    @classmethod
    async def start(cls, dut: Any) -> "DoubleBench":
        bench = cls(dut)
        await Timer(1, unit="ns")
        for sram in bench.srams:
            sram.start()
        bench.bus.start()
        cocotb.start_soon(bench.camera.run())
        await bench.set(RNW=1)
        await bench.set(ENABLE=1)
        return bench

    async def set(self, **levels: int) -> None:
        await wait(random.randrange(1, 200_000), ODD)
        for name, level in levels.items():
            getattr(self.dut, name).value = level

    async def begin(self, into: int) -> bytes:
        """Storing begins; the picture that comes."""
        await self.set(INTO=into)
        self.into = into
        await self.set(RNW=0)
        await self.set(INTO=random.getrandbits(1))
        await self.camera.reach(len(self.camera.clocks) + 3)
        content = picture()
        self.camera.send(frame(content))
        return content

    async def finish(self, into: int, content: bytes) -> None:
        """To ACK, and back to the bus."""
        limit = 100_000
        while not int(self.dut.ACK.value):
            limit -= 1
            assert limit, "no ACK"
            await wait(random.randrange(100_000), ODD)
        await self.set(RNW=1)
        self.into = None
        assert stored(self.srams[into]) == content
        await wait(1_000, ODD)
        assert not int(self.dut.ACK.value)


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


@timed_test
async def one_is_filled_while_the_other_is_worked_on(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    for into in (0, 1, 0, 1, random.getrandbits(1)):
        content = await bench.begin(into)
        await works_on(bench, 1 - into, 60)
        await bench.finish(into, content)


@timed_test
async def memory_that_is_filled_is_out_of_reach(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    for into in (0, 1):
        content = await bench.begin(into)
        for _ in range(30):
            address = into * MEMORY + random.randrange(MEMORY)
            if random.getrandbits(1):
                await bench.bus.write(address, random.getrandbits(8))
            else:
                assert await bench.bus.read(address) is None
        await bench.finish(into, content)


@timed_test
async def one_memory_serves_both_in_turn(dut: Any) -> None:
    """The other one has failed: it is not stored in, not asked, and never selected."""
    bench = await DoubleBench.start(dut)
    good = random.getrandbits(1)
    failed = getattr(dut, f"SRAM{2 - good}_CE_N")
    for _ in range(3):
        await bench.finish(good, await bench.begin(good))
        await works_on(bench, good, 20)
        assert int(failed.value)


@timed_test
async def standby_turns_all_off(dut: Any) -> None:
    bench = await DoubleBench.start(dut)
    await bench.begin(random.getrandbits(1))
    await bench.camera.reach(len(bench.camera.clocks) + random.randrange(20))
    await bench.set(ENABLE=0)
    bench.into = None
    await Timer(1, unit="ns")
    await ReadOnly()
    for name in ("ACK", "AD_LOW_O", "AD_LOW_OE", "SRAM1_A", "SRAM2_A", "SRAM1_D_OE", "SRAM2_D_OE"):
        assert int(getattr(dut, name).value) == 0
    for number in SRAMS:
        for name in ("CE_N", "OE_N", "WE_N"):
            assert int(getattr(dut, f"SRAM{number}_{name}").value) == 1
    await Timer(1, unit="ns")
    await bench.set(RNW=1)
    await bench.set(ENABLE=1)
    await bench.finish(1, await bench.begin(1))
