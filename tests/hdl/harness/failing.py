"""A cocotb test that fails, and one whose background task does: both must be noticed."""

from typing import Any

import cocotb
from cocotb.triggers import Timer


@cocotb.test()
async def passes(dut: Any) -> None:
    await Timer(1, unit="ns")


@cocotb.test()
async def fails(dut: Any) -> None:
    await Timer(1, unit="ns")
    raise AssertionError("as it should")


@cocotb.test()
async def fails_in_the_background(dut: Any) -> None:
    async def task() -> None:
        await Timer(1, unit="ns")
        raise AssertionError("as it should")

    cocotb.start_soon(task())
    await Timer(2, unit="ns")
