"""Rates, phases and idle times of what surrounds a top: fixed, or drawn at random within limits.

All times in ps. The limit of the data clock is the SRAM's access time: a simulation of gates
without delays has no other one, so it is no rate of the part.
"""

import random
from dataclasses import dataclass

from tests.hdl.harness.sram import SLOWEST_ACCESS

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
