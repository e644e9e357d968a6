"""How long transfers take on the bus, at full size."""

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import i2c_times
from i2c_bench import STANDBY, I2cBench, read
from i2c_bus import SPEEDS

from cubesense_fpga_i2c.register_table import ADDRESSES, Register, pointer_bytes
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import timed_test
from cubestack.hdl.contract.bench.timing import now
from tests.hdl.cubesense.reference import READ_OUT, SIDES


async def read_at(bench: I2cBench, side: str, x: int, y: int, count: int, down: bool) -> bytes:
    """The pixel and those after it, in one transfer."""
    mcu = bench.mcu
    assert await mcu.start(ADDRESSES[side])
    for byte in (Register.POINTER_HIGH, *pointer_bytes(x, y, down=down, size=READ_OUT)):
        assert await mcu.send(byte)
    assert await mcu.start(ADDRESSES[side], read=1)
    data = bytes([await mcu.receive(more=left > 0) for left in reversed(range(count))])
    await mcu.stop()
    return data


@contextmanager
def takes(bench: I2cBench, periods: Fraction, what: str) -> Iterator[None]:
    """Checks a duration in SCL periods, with the bus free between transfers."""
    before, bench.mcu.free_ps = now(), 0
    yield
    taken = now() - before - bench.mcu.free_ps
    assert taken == periods * bench.mcu.bit_ps, f"{what}: {taken} ps"
    print(f"{what} at {bench.mcu.speed} Hz: {periods} periods, {taken / 1e9:.3f} ms")


@timed_test
async def pieces(dut: Any) -> None:
    bench = await I2cBench.start(dut, cameras=())
    for speed in SPEEDS:
        bench.mcu.set_speed(speed)
        with takes(bench, i2c_times.COMMAND, "command"):
            await bench.mcu.command(STANDBY)
        with takes(bench, i2c_times.STATUS, "status"):
            await bench.mcu.status("sun")
        await bench.mcu.command(read(*SIDES))
        with takes(bench, i2c_times.PIXEL, "a pixel"):
            await read_at(bench, "nadir", 639, 479, 1, False)
        with takes(bench, i2c_times.read(3, 15), "a window's row"):
            await read_at(bench, "sun", 625, 3, 15, False)


@timed_test
async def window(dut: Any) -> None:
    """As the Sun's place is not known without a picture, three other bytes stand for it."""
    bench = await I2cBench.start(dut, cameras=(), speed=400_000)
    await bench.mcu.command(read("sun"))
    with takes(bench, i2c_times.window(), "window"):
        await bench.mcu.read("sun", Register.POINTER_HIGH, 3)
        for y in range(15):
            row = await read_at(bench, "sun", 200, 100 + y, 15, False)
            start = GEOMETRY.address(200, 100 + y)
            assert row == bench.srams["sun"].memory[start : start + 15]
