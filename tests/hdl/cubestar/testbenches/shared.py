"""One SRAM for camera and bus."""

from typing import Any

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.testbench import timed_test
from cubestack.hdl.contract.bench.watching import disturb_in_standby
from tests.hdl.cubestar.next_version import MEMORY, SharedTestbench


@timed_test
async def idle_is_reset(dut: Any) -> None:
    """In standby nothing on any other pin moves any output; the address latch is forgotten too."""
    bench = await SharedTestbench.start(dut)
    await bench.open()
    await bench.bus.address(2 * MEMORY - 1)
    await bench.standby()
    await Timer(1, unit="ns")
    bench.in_standby()
    pins = ("RNW", "BANK", "ALE", "CS_N", "RE_N", "WE_N", "AD_HIGH", "AD_LOW_I", "SRAM_D_I")
    await disturb_in_standby(dut, (*bench.standby_levels(), "SRAM_A"), pins, (5_000,), 1000)
