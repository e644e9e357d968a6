"""Pictures over the bus: stored from every camera in every memory, and read back."""

import random
from typing import Any

from i2c_bench import STANDBY, I2cBench, read, store

from cubesense_fpga_i2c.register_table import ADDRESSES, GROUP_ADDRESS, Register
from cubestack.firmware_model.interface.cubesense.fpga import Action, Actions
from cubestack.hdl.contract.bench.camera import flat, lines, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import timed_test
from tests.hdl.cubesense.pair import OTHER, frame
from tests.hdl.cubesense.reference import NOT_FOUND, READ_OUT, SIDES

FAST = 1_000_000
COLUMNS, ROWS, GAP = READ_OUT.columns, READ_OUT.rows, READ_OUT.frame_gap


@timed_test
async def every_camera_to_every_memory(dut: Any) -> None:
    bench = await I2cBench.start(dut, speed=FAST)
    paths = [(camera, memory) for camera in SIDES for memory in SIDES]
    random.shuffle(paths)
    for camera, memory in paths:
        content, other = picture(), bench.stored(OTHER[memory])
        await bench.shoot(camera, memory, content)
        assert bench.stored(OTHER[memory]) == other
        await bench.mcu.command(random.choice([read(memory), read(*SIDES)]))
        assert await bench.read_picture(memory) == content
        await bench.mcu.command(STANDBY)
    await bench.check()


@timed_test
async def both_at_once(dut: Any) -> None:
    bench = await I2cBench.start(dut, speed=FAST)
    await bench.mcu.command(Actions(Action.STORE, Action.STORE))
    contents = {side: picture() for side in SIDES}
    for side, camera in bench.cameras.items():
        await camera.reach(len(camera.clocks) + 3)
        camera.send(frame(contents[side]))
    for side in SIDES:
        assert await bench.acknowledged(side)
    await bench.mcu.command(read(*SIDES))
    for side in SIDES:
        assert await bench.read_picture(side) == contents[side]
    await bench.check()


@timed_test
async def traffic_does_not_disturb_a_picture(dut: Any) -> None:
    """The bus is never idle: registers answer while a picture is stored."""
    bench = await I2cBench.start(dut, speed=FAST)
    for camera, memory in [(side, random.choice(SIDES)) for side in SIDES]:
        await bench.mcu.command(store(camera, memory))
        source = bench.cameras[camera]
        await source.reach(len(source.clocks) + 3)
        content = picture()
        source.send(frame(content))
        while source.busy:
            side = random.choice(SIDES)
            await bench.mcu.point(side, 1, 1, bool(random.getrandbits(1)), READ_OUT)
            number = random.choice([Register.COMMAND, Register.POINTER_HIGH, Register.DATA])
            await bench.mcu.read(side, number, 1)
            await bench.mcu.read(memory, Register.SUN_HIGH, 3)
        assert await bench.acknowledged(memory)
        await bench.mcu.command(STANDBY)
        assert bench.stored(memory) == content
    await bench.check()


@timed_test
async def dead_camera_and_failed_memory(dut: Any) -> None:
    """The other half's camera and memory serve, with one pixel clock and with none."""
    dead = random.choice(SIDES)
    live, failed = OTHER[dead], random.choice([OTHER[dead], ""])
    bench = await I2cBench.start(dut, cameras=(live,), failed_sram=failed, speed=FAST)
    for memory in SIDES:
        if memory != failed:
            content = picture()
            await bench.shoot(live, memory, content)
            await bench.mcu.command(read(memory))
            assert await bench.read_picture(memory) == content
    await bench.mcu.command(store(dead, dead))
    assert not await bench.acknowledged(dead, polls=5)


@timed_test
async def sun_is_found_while_storing(dut: Any) -> None:
    """In either memory; the registers show it from standby on, and outlive other pictures."""
    bench = await I2cBench.start(dut, speed=FAST)
    for _ in range(4):
        memory = random.choice(SIDES)
        x, y = random.randrange(COLUMNS - 2), random.randrange(ROWS)
        content = bytearray(random.choices(range(200), k=GEOMETRY.pixels))
        if random.random() < 0.8:
            content[y * COLUMNS + x : y * COLUMNS + x + 3] = bytes([200, 255, 231])
        else:
            x, y = NOT_FOUND
        await bench.shoot("sun", memory, bytes(content))
        if random.getrandbits(1):
            await bench.shoot("nadir", random.choice(SIDES), picture())
        bench.models[memory].sun = GEOMETRY.address(x, y)
        found = await bench.mcu.read(memory, Register.SUN_HIGH, 3)
        assert int.from_bytes(found, "big") == GEOMETRY.address(x, y)
    await bench.check()


@timed_test
async def any_command_at_any_time(dut: Any) -> None:
    """Listed and unlisted ones, with frames of any shape; pulses to the picosecond."""
    by_standby = bool(random.getrandbits(1))
    bench = await I2cBench.start(dut, speed=FAST)
    for _ in range(14):
        for source in bench.cameras.values():
            for _ in range(2 * ROWS):
                row = random.randbytes(random.choice([COLUMNS] * 8 + [1, COLUMNS + 1]))
                source.send(flat(lines(row)))
                if random.random() < 1 / ROWS:
                    source.send(frame(b"")[: random.choice([GAP - 2, GAP, GAP + 9])])
        byte = random.choice([random.randrange(256), 0, 1, 2, 8, 12])
        await bench.mcu.write(GROUP_ADDRESS, Register.COMMAND, [byte])
        for side in random.choices(SIDES, k=2):
            await bench.mcu.status(side)
            await bench.mcu.read(side, Register.DATA, random.randint(1, 5))
        if by_standby or random.getrandbits(1):
            await bench.mcu.command(STANDBY)
        if random.random() < 0.2:
            start = await bench.mcu.start(ADDRESSES[random.choice(SIDES)])
            assert start
            await bench.mcu.send(Register.COMMAND)
            assert not await bench.mcu.send(0), "a command not through the group's address"
            await bench.mcu.stop()
    await bench.check(by_standby=by_standby)
