"""How long the scan and a whole picture take on the bus; minutes of simulation."""

from typing import Any

import cocotb
import i2c_times
from benches_i2c_times import read_at, takes
from geometry import GEOMETRY
from i2c_bench import I2cBench, read
from small import READ_OUT


@cocotb.test(timeout_time=10, timeout_unit="sec")
async def nadir_scan(dut: Any) -> None:
    bench = await I2cBench.start(dut, cameras=(), speed=400_000)
    await bench.mcu.command(read("nadir"))
    data = b""
    with takes(bench, i2c_times.scan(), "scan"):
        for y in READ_OUT.scan_rows:
            data += await read_at(bench, "nadir", 0, y, READ_OUT.columns, False)
        for x in READ_OUT.scan_columns:
            data += await read_at(bench, "nadir", x, 0, READ_OUT.rows, True)
    memory = bench.srams["nadir"].memory
    pixels = [pixel for pixel in READ_OUT.scan() if pixel is not None]
    assert data == bytes(memory[GEOMETRY.address(x, y)] for x, y in pixels)


@cocotb.test(timeout_time=100, timeout_unit="sec")
async def whole_picture(dut: Any) -> None:
    bench = await I2cBench.start(dut, cameras=(), speed=1_000_000)
    await bench.mcu.command(read("sun"))
    with takes(bench, i2c_times.PICTURE, "picture"):
        data = await read_at(bench, "sun", 0, 0, READ_OUT.pixels, False)
    assert data == bench.stored("sun")
