"""The reader alone, with a memory that answers at once."""

import random
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.timing import some_time


async def clock(dut: Any, memory: bytes, reset: int = 0) -> int:
    dut.dclk_clk.value = 0
    dut.dclk_rst.value = reset
    await some_time()
    dut.memory.value = memory[int(dut.address.value)]
    await some_time()
    dut.dclk_clk.value = 1
    await some_time()
    dut.memory.value = random.randrange(256)
    await Timer(1, unit="ns")
    return int(dut.data.value)


@cocotb.test()
async def presents_the_picture_without_end(dut: Any) -> None:
    for length in (GEOMETRY.pixels // 2, 3 * GEOMETRY.pixels):
        memory = random.randbytes(GEOMETRY.bank_size)
        picture = [memory[address] for address in GEOMETRY.addresses()]
        assert await clock(dut, memory, reset=1) == 0
        for step in range(length):
            assert await clock(dut, memory) == picture[step % GEOMETRY.pixels]
