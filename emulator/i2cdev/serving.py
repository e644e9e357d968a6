"""The scheduler of an emulation whose ports other programs open: wired in this one place.

Serial ports alone are served by a :class:`RealtimeScheduler`. With an I2C bus, an
:class:`I2cScheduler` stands before it: it takes the bus's calls as they come, and tells the wall
time by which both of them pace.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.pacing import sharpen_timers, wait_precisely
from cubestack.emulator.i2cdev.scheduler import I2cScheduler
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.sim.virtual_time import Kernel


@contextmanager
def open_scheduler(
    kernel: Kernel,
    endpoints: Sequence[Endpoint],
    busy: Callable[[], bool],
    *,
    pace: Literal["real", "fast"],
    i2c: I2cAdapter | None = None,
    i2c_ports: Sequence[Endpoint] = (),
    always_asleep: bool = False,
    report: Callable[[str], None] = lambda _text: None,
) -> Iterator[RealtimeScheduler]:
    """A scheduler for ``endpoints`` and a bus, to be run in a ``with`` block.

    ``run()`` serves until ``stop()``, which a thread, a signal handler or a port may call::

        with open_scheduler(board.kernel, [endpoint], board.busy, pace="fast") as scheduler:
            signal.signal(signal.SIGINT, lambda _number, _frame: scheduler.stop())
            scheduler.run()

    Args:
        kernel: that of the boards; its time is in ps.
        endpoints: open ports other than those of the bus; closed by their owner, as all ports.
        busy: whether the boards have work of their own.
        pace: "real" (virtual time is wall time) or "fast" (ahead of it while there is work).
        i2c: master of the boards' I2C bus; None when no program can reach that.
        i2c_ports: where the calls for ``i2c`` come from, for instance an I2cServer.
        always_asleep: whether the next call is never waited for awake, as the caller needs this
            processor.
        report: receives a line when pace "real" can not be kept.
    """
    if i2c is None:
        yield RealtimeScheduler(kernel, endpoints, busy, pace=pace, report=report)
        return
    adapter = i2c
    sharpen_timers()
    calls = I2cScheduler(
        "I2C bus", adapter, i2c_ports, busy, fast=pace == "fast", always_asleep=always_asleep
    )
    try:
        yield RealtimeScheduler(
            kernel,
            [calls, *endpoints],
            lambda: adapter.busy or busy(),
            pace=pace,
            report=report,
            clock_ns=calls.clock_ns,
            wait=wait_precisely,
        )
    finally:
        calls.close()
