"""What every top has to do: store, be left at any moment, give back what it stored.

``TESTBENCH`` in the environment names the testbench.
"""

import os
import random
from importlib import import_module
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import Testbench
from cubestack.hdl.contract.bench.timing import ODD, PRESSURES, Timing, wait
from tests.hdl.coverage.points import hit

MODULE, NAME = os.environ["TESTBENCH"].split(":")
TESTBENCH: Any = getattr(import_module(MODULE), NAME)

#: Slower than :func:`timed_test` allows for: 1 MHz takes its time.
slow_test = cocotb.test(timeout_time=300, timeout_unit="ms")


async def works(bench: Testbench[Any], place: Any) -> None:
    """A picture is stored and comes back. From any state, to standby."""
    await bench.standby()
    content = await bench.shoot(place)
    assert await bench.fetch(place) == content


@slow_test
@cocotb.parametrize(pressure=list(PRESSURES))
async def under_pressure(dut: Any, pressure: str) -> None:
    bench = await TESTBENCH.start(dut, PRESSURES[pressure])
    for place in TESTBENCH.PLACES:
        await works(bench, place)
    await bench.check()
    hit("pressure", testbench=TESTBENCH.__name__, pressure=pressure)


@slow_test
async def left_at_any_moment(dut: Any) -> None:
    """While a picture is stored; the place's next one is whole all the same."""
    bench = await TESTBENCH.start(dut, Timing(idles=(0, 100_000)))
    for _ in range(12):
        place = random.choice(TESTBENCH.PLACES)
        await bench.begin(place, picture())
        await wait(random.randrange(3 * GEOMETRY.pixels * 200_000), ODD)
        await bench.standby()
        await Timer(1, unit="ns")
    for place in TESTBENCH.PLACES:
        await bench.camera_of(place).sent()
    for place in TESTBENCH.PLACES:
        await works(bench, place)
    await bench.check()
