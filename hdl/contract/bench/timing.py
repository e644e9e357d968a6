"""Rates, phases and idle times of what surrounds a top: fixed, or drawn at random within limits.

All times in ps. The limit of the data clock is the SRAM's access time: a simulation of gates
without delays has no other one, so it is no rate of the part.
"""

import random
from dataclasses import dataclass
from typing import Any

from cocotb.triggers import Timer
from cocotb.utils import get_sim_time

#: Longest time in ps from an address to its byte. The real part is quicker than this.
SLOWEST_ACCESS = 12_000

#: Halves of the data clock in ps by name: the processors' (37 cycles of 48 MHz, two instructions
#: of 5 MHz), 1 MB/s, and the limit.
DATA_HALVES = {
    "37 cycles": 385_400,
    "2 instructions": 200_000,
    "1 MHz": 500_000,
    "limit": SLOWEST_ACCESS // 2 + 2,
}


@dataclass(frozen=True)
class Timing:
    """Each pair is the least and the most, for :func:`between`."""

    pixel_periods: tuple[int, int] = (50_000, 200_000)  # of the camera's clock, once for a bench
    phases: tuple[float, float] = (0.0, 1.0)  # of its first edge, in parts of its period
    duties: tuple[float, float] = (0.3, 0.7)  # high part of its period
    stall_rates: tuple[float, ...] = (0.0, 0.02, 0.1)  # so often a half of it is 2 to 20 as long
    data_halves: tuple[int, int] = (4_000, 100_000)  # of the data clock, which waits for the SRAM
    idles: tuple[int, int] = (0, 500_000)  # between two actions of the processor
    pauses: tuple[int, int] = (1_000, 20_000)  # between two changes of the external bus's pins


ANY = Timing()  #: Rates at random, unless a test says more

#: Idle times and back-pressure by name.
PRESSURES = {
    "steady": Timing(stall_rates=(0.0,), idles=(50_000, 50_000), pauses=(5_000, 5_000)),
    "stalling camera": Timing(stall_rates=(0.5,)),
    "lopsided clock": Timing(pixel_periods=(50_000, 50_000), duties=(0.12, 0.88)),
    "hurried processor": Timing(data_halves=(1, DATA_HALVES["limit"]), idles=(0, 0), pauses=(1, 1)),
    "slow processor": Timing(
        data_halves=(100_000, 1_000_000), idles=(0, 5_000_000), pauses=(1_000, 200_000)
    ),
}


def fixed(pixel_mhz: float, data_half: int, phase: float) -> Timing:
    """Two clocks that keep their rates; only the idle times are random."""
    period = round(1e6 / pixel_mhz)
    return Timing(
        pixel_periods=(period, period),
        phases=(phase, phase),
        duties=(0.5, 0.5),
        stall_rates=(0.0,),
        data_halves=(data_half, data_half),
    )


def between(limits: tuple[int, int]) -> int:
    return random.randint(*limits)


#: The camera acts at even picoseconds and the microcontroller at odd ones. In a real flip-flop the
#: result of a coincidence is open; in a simulation it would be an accident of the order of events.
EVEN, ODD = 0, 1


def now() -> int:
    """Simulated time in ps."""
    return int(get_sim_time("step"))


async def wait(ps: int, parity: int) -> None:
    """Wait for ``ps``, or one more, until a picosecond of that ``parity``; never for nothing."""
    await Timer(max(ps, 1) + (now() + max(ps, 1) + parity) % 2, unit="step")


async def some_time() -> None:
    await Timer(random.randint(1, 50), unit="ns")


async def clock(dut: Any, domain: str, reset: int = 0, **pins: int) -> None:
    """Drive ``pins``, then one rising edge of the domain's clock; falls at the next call."""
    getattr(dut, f"{domain}_clk").value = 0
    getattr(dut, f"{domain}_rst").value = reset
    for name, level in pins.items():
        getattr(dut, name).value = level
    await some_time()
    getattr(dut, f"{domain}_clk").value = 1
    await some_time()
