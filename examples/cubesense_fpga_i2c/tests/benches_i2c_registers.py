"""Registers over the bus, without a pixel clock: any transfer, well-formed or not."""

import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from cocotb.triggers import Timer
from i2c_bench import STANDBY, I2cBench, read
from i2c_bus import SPEEDS
from i2c_model import Phase

from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    RESET_COMMAND,
    WHO,
    Register,
    command_byte,
)
from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import timed_test
from cubestack.hdl.contract.bench.timing import ODD, wait
from tests.hdl.cubesense.reference import READ_OUT, SIDES

FAST = 1_000_000
ALL = (*ADDRESSES.values(), GROUP_ADDRESS)


@asynccontextmanager
async def registers(dut: Any) -> AsyncIterator[I2cBench]:
    """A bench with idle cameras, after both halves have received an image of the Sun."""
    bench = await I2cBench.start(dut, speed=FAST)
    for side in SIDES:
        content = bytearray(picture())
        content[3:6] = bytes([220] * 3)
        await bench.shoot("sun", side, bytes(content))
    for camera in bench.cameras.values():
        camera.stop()
    halves = await bench.check()
    for side, half in halves.items():
        assert half.sun is not None
        bench.models[side].sun = GEOMETRY.address(*half.sun)
    yield bench
    await bench.check()


@timed_test
async def answers_from_reset_on(dut: Any) -> None:
    """With both pixel clocks dead, at whatever level they stopped."""
    bench = await I2cBench.start(dut, cameras=())
    for speed in SPEEDS:
        bench.mcu.set_speed(speed)
        for side in SIDES:
            assert await bench.mcu.read(side, Register.WHO_AM_I, 3) == bytes(
                [WHO[side], 0, RESET_COMMAND]
            )
            assert await bench.mcu.read(side, Register.POINTER_HIGH, 3) == bytes(3)
    await bench.check()


@timed_test
async def reads_memory_at_every_speed(dut: Any) -> None:
    """Both ways, across the borders, in pieces, in turn with the other FPGA."""
    async with registers(dut) as bench:
        await bench.mcu.command(read(*SIDES))
        for speed in SPEEDS:
            bench.mcu.set_speed(speed)
            for _ in range(6):
                side, down = random.choice(SIDES), bool(random.getrandbits(1))
                x = random.choice([0, READ_OUT.columns - 1, random.randrange(READ_OUT.columns)])
                y = random.choice([0, READ_OUT.rows - 1, random.randrange(READ_OUT.rows)])
                await bench.mcu.point(side, x, y, down, READ_OUT)
                await bench.mcu.read(side, None, random.randint(1, 3))
                await bench.mcu.read(random.choice(SIDES), Register.DATA, 2)
                await bench.mcu.read(side, None, random.randint(1, READ_OUT.columns))


@timed_test
async def any_transfer(dut: Any) -> None:
    """Any address, register and length; left at any byte; next START repeated or not."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for _ in range(150):
            address = random.choice([*ALL, *ALL, random.randrange(128)])
            if await mcu.start(address, random.getrandbits(1)):
                if any(model.phase is Phase.READ for model in bench.models.values()):
                    for left in reversed(range(random.randint(1, 5))):
                        await mcu.receive(more=left > 0)
                else:
                    # Any command but those that store: these need a camera.
                    command = random.choice([4, 5, 6, int(RESET_COMMAND), 0xF4])
                    await mcu.send(random.choice([*Register, random.randrange(256)]))
                    for _ in range(random.randrange(4)):
                        is_command = any(
                            model.number == Register.COMMAND for model in bench.models.values()
                        )
                        await mcu.send(command if is_command else bench.pointer_byte())
            if random.random() < 0.6:
                await mcu.stop()
        await mcu.stop()


@timed_test
async def unwritable_registers_and_unknown_addresses(dut: Any) -> None:
    """What can not be written is not acknowledged, nor what follows; nor an unknown address."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for side, address in ADDRESSES.items():
            for number in {*range(16)} - {*range(Register.POINTER_HIGH, Register.DATA)}:
                assert await mcu.start(address)
                assert await mcu.send(number)
                assert not await mcu.send(0xA5)
                assert not await mcu.send(0x5A)
                await mcu.stop()
            assert (await mcu.read(side, Register.COMMAND, 1))[0] == RESET_COMMAND
        for address in {*range(128)} - {*ALL}:
            assert not await mcu.start(address, random.getrandbits(1))
        assert not await mcu.start(GROUP_ADDRESS, read=1)
        await mcu.stop()


@timed_test
async def aborted_transfers(dut: Any) -> None:
    """Inside of a byte, by START or by STOP: nothing is taken, and the next transfer is whole.

    After a STOP clocks without a START are nothing.
    """
    async with registers(dut) as bench:
        mcu = bench.mcu
        await mcu.command(read(*SIDES))
        for _ in range(60):
            side = random.choice(SIDES)
            address = random.choice([ADDRESSES[side], GROUP_ADDRESS])
            assert await mcu.start(address)
            assert await mcu.send(random.choice([Register.COMMAND, Register.POINTER_MID]))
            for _ in range(random.choice([7, random.randrange(8)])):
                await mcu.master.send_bit(random.getrandbits(1))
            if random.getrandbits(1):
                await mcu.stop()
                await mcu.clock(random.choice([0, 1, 2, 9, 20]))
            await mcu.read(side, Register.COMMAND, 1)
            await mcu.read(side, Register.POINTER_HIGH, 3)


@timed_test
async def held_bus_is_freed_by_nine_clocks(dut: Any) -> None:
    """The microcontroller restarts while an FPGA sends; STOP and START are possible again."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for _ in range(20):
            side = random.choice(SIDES)
            assert await mcu.start(ADDRESSES[side], read=random.getrandbits(1))
            held = random.randrange(9)
            for _ in range(held):
                await mcu.master.recv_bit()
            # Its end of the bus restarts: both lines are released, in any order.
            model = bench.models[side]
            if model.phase is Phase.READ:
                model.read(more=held < 8)
            elif held >= 8:
                model.write(0xFF)
            mcu.master.bus_active = False
            dut.SDA_I.value = 1
            await Timer(mcu.bit_ps, unit="step")
            dut.SCL.value = 1
            await Timer(mcu.bit_ps, unit="step")
            clocks = 0
            while not int(dut.SDA.value):
                await mcu.clock(1)
                clocks += 1
            assert clocks <= 9
            # Whatever they made of the clocks: registers are as the FPGAs say, from now on.
            mcu.master.bus_active = True
            await mcu.master.send_stop()
            model.stop()
            await bench.resynchronise()


@timed_test
async def slow_and_stopped_clocks(dut: Any) -> None:
    """SCL may rest at any level for any time, and be as slow as the microcontroller likes."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for _ in range(8):
            side = random.choice(SIDES)
            assert await mcu.start(ADDRESSES[side])
            await wait(random.randrange(10**8), ODD)
            assert await mcu.send(Register.POINTER_HIGH)
            await wait(random.randrange(10**8), ODD)
            assert await mcu.send(bench.pointer_byte())
            await mcu.stop()
            mcu.set_speed(random.choice([20_000, 50_000, FAST]))
            await mcu.read(side, Register.POINTER_HIGH, 1)


@timed_test
async def spikes(dut: Any) -> None:
    """On SDA while SCL is low they are nothing; on SCL they cost the transfer, not the next."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for _ in range(25):
            side = random.choice(SIDES)
            assert await mcu.start(ADDRESSES[side])
            for _ in range(random.randrange(5)):
                dut.SDA_I.value = random.getrandbits(1)
                await Timer(random.randint(1, 5), unit="ns")
            assert await mcu.send(Register.POINTER_LOW)
            assert await mcu.send(value := bench.pointer_byte())
            if random.getrandbits(1):
                for _ in range(random.randint(1, 7)):
                    dut.SCL.value = 1
                    await Timer(20, unit="ns")
                    dut.SCL.value = 0
                    await Timer(20, unit="ns")
            # The next START, be it repeated, finds the target as it was.
            low = await mcu.read(side, Register.POINTER_LOW, 1)
            assert low[0] == bench.models[side].pointer & 0xFF
            assert value is not None


@timed_test
async def reset_at_any_time(dut: Any) -> None:
    """Lets go of the bus and of the memory at once; every register is as at first."""
    async with registers(dut) as bench:
        mcu = bench.mcu
        for _ in range(20):
            side = random.choice(SIDES)
            await mcu.command(read(*SIDES))
            await mcu.point(side, 1, 1, True, READ_OUT)
            assert await mcu.start(ADDRESSES[side], random.getrandbits(1))
            for _ in range(random.randrange(9)):
                await mcu.master.recv_bit()
            dut.RESET_N.value = 0
            await Timer(1, unit="ns")
            bench.idle()
            dut.SDA_I.value = dut.SCL.value = 1
            mcu.master.bus_active = False
            await Timer(mcu.bit_ps, unit="step")
            dut.RESET_N.value = 1
            await Timer(mcu.bit_ps, unit="step")
            bench.reset_models()
            for other in SIDES:
                await mcu.read(other, Register.COMMAND, 1)
                await mcu.read(other, Register.POINTER_HIGH, 3)
            assert (await mcu.read(side, Register.COMMAND, 1))[0] == command_byte(STANDBY)
