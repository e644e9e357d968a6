"""A picture is stored and given back at every rate and phase of both clocks, by every top."""

import random
from typing import Any

import cocotb
from benches_any_top import BENCH, slow_test, works
from cover import hit
from cover_points import PHASES, PIXEL_MHZ
from timing import DATA_HALVES, fixed


@slow_test
@cocotb.parametrize(pixel_mhz=PIXEL_MHZ, data=list(DATA_HALVES), phase=range(PHASES))
async def at_fixed_rates(dut: Any, pixel_mhz: float, data: str, phase: int) -> None:
    bench = await BENCH.start(dut, fixed(pixel_mhz, DATA_HALVES[data], phase / PHASES))
    await works(bench, random.choice(BENCH.PLACES))
    await bench.check()
    hit("rates", bench=BENCH.__name__, pixel_mhz=pixel_mhz, data=data, phase=phase)
