"""What every top has to do: store, be left at any moment, give back what it stored.

``BENCH`` in the environment names the bench.
"""

import os
import random
from importlib import import_module
from typing import Any

import cocotb
from bench import Camera, Surroundings, picture
from cocotb.triggers import Timer
from cover import hit
from geometry import GEOMETRY
from instants import ODD, wait
from timing import PRESSURES, Timing

MODULE, NAME = os.environ["BENCH"].split(":")
BENCH: type[Surroundings] = getattr(import_module(MODULE), NAME)

#: Slower than :func:`bench.timed_test` allows for: 1 MHz takes its time.
slow_test = cocotb.test(timeout_time=300, timeout_unit="ms")


def cameras(bench: Any) -> list[Camera]:
    """One, or the sun's and the nadir's."""
    return list(bench.cameras.values()) if hasattr(bench, "cameras") else [bench.camera]


async def works(bench: Surroundings, place: Any) -> None:
    """A picture is stored and comes back. From any state, to standby."""
    await bench.standby()
    content = picture()
    await bench.begin(place, content)
    assert await bench.acknowledged(place)
    await bench.standby()
    assert await bench.fetch(place) == content


@slow_test
@cocotb.parametrize(pressure=list(PRESSURES))
async def under_pressure(dut: Any, pressure: str) -> None:
    bench = await BENCH.start(dut, PRESSURES[pressure])
    for place in BENCH.PLACES:
        await works(bench, place)
    await bench.check()
    hit("pressure", bench=BENCH.__name__, pressure=pressure)


@slow_test
async def left_at_any_moment(dut: Any) -> None:
    """While a picture is stored; the place's next one is whole all the same."""
    bench = await BENCH.start(dut, Timing(idles=(0, 100_000)))
    for _ in range(12):
        place = random.choice(BENCH.PLACES)
        await bench.begin(place, picture())
        await wait(random.randrange(3 * GEOMETRY.pixels * 200_000), ODD)
        await bench.standby()
        await Timer(1, unit="ns")
    for camera in cameras(bench):
        await camera.sent()
    for place in BENCH.PLACES:
        await works(bench, place)
    await bench.check()
