"""All 19 bits of the pointer: pixels of full-size memories, across rows, columns and borders."""

import random
from typing import Any

from i2c_bench import I2cBench, read

from cubesense_fpga_i2c.register_table import Register
from cubestack.hdl.contract.bench.testbench import timed_test
from tests.hdl.cubesense.reference import READ_OUT, SIDES

COLUMNS, ROWS = READ_OUT.columns, READ_OUT.rows


@timed_test
async def any_pixel(dut: Any) -> None:
    bench = await I2cBench.start(dut, cameras=(), speed=1_000_000)
    await bench.mcu.command(read(*SIDES))
    corners = [(x, y) for x in (0, COLUMNS - 1) for y in (0, ROWS - 1)]
    others = [(random.randrange(COLUMNS), random.randrange(ROWS)) for _ in range(20)]
    powers = [((1 << bit) - 1, (1 << bit % 9) - 2) for bit in range(1, 10)]
    for x, y in [*corners, *others, *powers]:
        side, down = random.choice(SIDES), bool(random.getrandbits(1))
        await bench.mcu.point(side, x, max(y, 0), down, READ_OUT)
        await bench.mcu.read(side, Register.DATA, 3)
        await bench.mcu.read(side, Register.POINTER_HIGH, 3)
    await bench.check()
