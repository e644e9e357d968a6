"""Shared parts of the benchmarks."""

import time
from collections.abc import Callable

from cubestack.host.emulation.emulated import AnyEmulated

LOOP_S = 10
"""Virtual time over which a loop is measured."""

ROUNDS = 5
"""Repetitions of short measurements: the best counts, the rest is noise of the machine."""


def simulated_ratio(emulated: AnyEmulated, run: Callable[[], None]) -> float:
    """Simulated seconds per wall second of ``run``."""
    virtual, wall = emulated.time_s, time.perf_counter()
    run()
    return round((emulated.time_s - virtual) / (time.perf_counter() - wall), 2)


def best_ms(run: Callable[[], object]) -> float:
    """Wall time of ``run`` in ms, the best of ``ROUNDS``."""
    times = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return round(1000 * min(times), 1)
