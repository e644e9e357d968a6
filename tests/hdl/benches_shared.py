"""One SRAM for camera and bus: who has it, and that neither disturbs the other."""

import random
from typing import Any

import cocotb
from bench import frame, picture, timed_test
from bench_next import STANDBY, SharedBench
from cocotb.triggers import Timer
from ebi import stored
from geometry import GEOMETRY
from instants import ODD, wait

SIZE = 2 * GEOMETRY.bank_size


@timed_test
async def bus_has_the_whole_memory(dut: Any) -> None:
    """Reads and writes in any order against an array."""
    bench = await SharedBench.start(dut)
    await bench.open()
    expected = bytearray(bench.sram.memory)
    for _ in range(300):
        address = random.randrange(SIZE)
        if random.getrandbits(1):
            expected[address] = random.getrandbits(8)
            await bench.bus.write(address, expected[address])
        else:
            assert await bench.bus.read(address) == expected[address]
    await bench.mcu.standby()
    assert bench.sram.memory == expected
    assert bench.sram.edges == len(bench.sram.pulses), "a write pulse that was none"
    await bench.check()


@timed_test
async def picture_is_worked_on_where_it_was_stored(dut: Any) -> None:
    bench = await SharedBench.start(dut)
    for bank in (0, 1, 0):
        content = await bench.shoot(bank)
        await bench.open()
        for _ in range(30):
            x, y = random.randrange(GEOMETRY.columns), random.randrange(GEOMETRY.rows)
            address = GEOMETRY.address(x, y, bank)
            assert await bench.bus.read(address) == content[y * GEOMETRY.columns + x]
        await bench.bus.write(GEOMETRY.address(0, 0, bank), content[0] ^ 0xFF)
        assert await bench.bus.read(GEOMETRY.address(0, 0, bank)) == content[0] ^ 0xFF
        await bench.mcu.standby()
    await bench.check()


@timed_test
async def bus_is_cut_off_while_storing(dut: Any) -> None:
    """Accesses then have no effect at all, and nothing answers."""
    bench = await SharedBench.start(dut)

    async def meddle() -> None:
        while True:
            address = random.randrange(SIZE)
            if random.getrandbits(1):
                await bench.bus.write(address, random.getrandbits(8))
            else:
                assert await bench.bus.read(address) is None

    for bank in (1, 0):
        other = stored(bench.sram, 1 - bank)
        await bench.store(bank)
        meddling = cocotb.start_soon(meddle())
        content = picture()
        bench.camera.send(frame(content))
        assert await bench.acknowledged(bank)
        meddling.cancel()
        for name in ("CS_N", "RE_N", "WE_N"):
            getattr(dut, name).value = 1
        bench.bus.drives = True
        await bench.mcu.standby()
        assert (stored(bench.sram, bank), stored(bench.sram, 1 - bank)) == (content, other)
    await bench.check()


@timed_test
async def idle_is_reset(dut: Any) -> None:
    """In standby nothing on any other pin moves any output; the address latch is forgotten too."""

    async def stands_still(name: str) -> None:
        await getattr(dut, name).value_change
        raise AssertionError(f"{name} moved in standby")

    bench = await SharedBench.start(dut)
    await bench.open()
    await bench.bus.address(SIZE - 1)
    await bench.mcu.standby()
    await Timer(1, unit="ns")
    bench.in_standby()
    watches = [cocotb.start_soon(stands_still(name)) for name in (*STANDBY, "SRAM_A")]
    pins = ("RNW", "BANK", "ALE", "CS_N", "RE_N", "WE_N", "AD_HIGH", "AD_LOW_I", "SRAM_D_I")
    for _ in range(1000):
        await wait(random.randint(1, 5_000), ODD)
        pin = getattr(dut, random.choice(pins))
        pin.value = random.getrandbits(len(pin))
    for watch in watches:
        watch.cancel()


@timed_test
async def strobes_together_read(dut: Any) -> None:
    """A processor never does that; FPGA and SRAM must not fight over it."""
    bench = await SharedBench.start(dut)
    await bench.open()
    before = bytes(bench.sram.memory)
    for _ in range(4):
        address = random.randrange(SIZE)
        assert await bench.bus.read_and_write(address) == before[address]
    assert (bench.sram.memory, bench.sram.edges) == (before, 0)
    await bench.check()


@timed_test
async def standby_answers_nothing(dut: Any) -> None:
    bench = await SharedBench.start(dut)
    before = bytes(bench.sram.memory)
    for _ in range(40):
        address = random.randrange(SIZE)
        if random.getrandbits(1):
            await bench.bus.write(address, random.getrandbits(8))
        else:
            assert await bench.bus.read(address) is None
    assert bench.sram.memory == before
    await bench.check()
