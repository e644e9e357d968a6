"""Simulated time in whole picoseconds, kept apart for what runs on unrelated clocks.

The camera acts at even picoseconds and the microcontroller at odd ones. In a real flip-flop the
result of a coincidence is open; in a simulation it would be an accident of the order of events.
"""

from cocotb.triggers import Timer
from cocotb.utils import get_sim_time

EVEN, ODD = 0, 1


def now() -> int:
    """Simulated time in ps."""
    return int(get_sim_time("step"))


async def wait(ps: int, parity: int) -> None:
    """Wait for ``ps``, or one more, until a picosecond of that ``parity``; never for nothing."""
    await Timer(max(ps, 1) + (now() + max(ps, 1) + parity) % 2, unit="step")
