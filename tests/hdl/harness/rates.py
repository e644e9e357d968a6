"""A picture is stored and given back at every rate and phase of both clocks, by every top."""

import random
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.timing import DATA_HALVES, fixed
from tests.hdl.coverage.points import PHASES, PIXEL_MHZ, hit
from tests.hdl.harness.any_top import TESTBENCH, slow_test, works


@slow_test
@cocotb.parametrize(pixel_mhz=PIXEL_MHZ, data=list(DATA_HALVES), phase=range(PHASES))
async def at_fixed_rates(dut: Any, pixel_mhz: float, data: str, phase: int) -> None:
    bench = await TESTBENCH.start(dut, fixed(pixel_mhz, DATA_HALVES[data], phase / PHASES))
    await works(bench, random.choice(TESTBENCH.PLACES))
    await bench.check()
    hit("rates", testbench=TESTBENCH.__name__, pixel_mhz=pixel_mhz, data=data, phase=phase)
