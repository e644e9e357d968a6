"""A port by which other threads act on a running emulation: between two of its events, in its
own thread, so that nothing is ever half done.

Held, virtual time stands: an act that changes something has its effect when time goes on. It goes
on for good, for so many events, or up to a time.
"""

import os
import select
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pace import Mode
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

if TYPE_CHECKING:
    from cubestack.emulator.ports.realtime import RealtimeScheduler

HOLDER = "control"
"""Who holds the kernel."""

SLICE_NS = 20_000_000
"""Wall time that is worked towards a time before the other ports are looked at."""

MOST_EVENTS = 100_000
"""Of one step: some seconds of wall time."""

FASTEST, SLOWEST = 1000.0, 0.001

ENDED = "the emulation has ended"

T = TypeVar("T")


class ControlPort(Endpoint):
    """Attributes:
    kernel: virtual time.
    scheduler: that serves this port; set by who makes it.
    """

    name = "control"

    def __init__(self, kernel: Kernel) -> None:
        """Control ``kernel``."""
        self.kernel = kernel
        self.scheduler: RealtimeScheduler | None = None
        self._calls = SimpleQueue[Callable[[], None]]()
        self._hears, self._rings = os.pipe()
        os.set_blocking(self._hears, False)
        os.set_blocking(self._rings, False)
        self._until_ps: int | None = None
        self._arrived = Future[int]()
        self._waiting = set[Future[Any]]()
        self._lock = Lock()
        self._closed = False

    # --- for any thread -------------------------------------------------------------------------

    def call(self, act: Callable[[], T]) -> "Future[T]":
        """What ``act`` gives between two events; RuntimeError when the emulation has ended."""
        future = Future[T]()
        with self._lock:
            if self._closed:
                future.set_exception(RuntimeError(ENDED))
            else:
                self._calls.put(partial(_settle, future, act))
                self._waiting.add(future)
                self._ring()
        future.add_done_callback(self._waiting.discard)
        return future

    # --- for what is called ---------------------------------------------------------------------

    @property
    def held(self) -> bool:
        """Whether virtual time stands: held here, or by a debugger."""
        return self.kernel.paused

    def pause(self) -> None:
        """Hold virtual time."""
        self._forget("held")
        self.kernel.hold(HOLDER)

    def resume(self) -> None:
        """Let it go on from here."""
        self._forget("resumed")
        self._release()

    def step(self, events: int = 1) -> int:
        """Let so many events happen, then hold; returns how many there were.

        Raises ValueError for a number out of 1 to `MOST_EVENTS`, and where a debugger holds it.
        """
        if not 1 <= events <= MOST_EVENTS:
            raise ValueError(f"a step is 1 to {MOST_EVENTS} events, not {events}")
        self._check_debugger()
        self._forget("stepped")
        self._release()
        done = 0
        while done < events and self.kernel.horizon() is not None and not self.held:
            self.kernel.step()
            done += 1
        self.kernel.hold(HOLDER)
        return done

    def run_to(self, time_ps: int) -> "Future[int]":
        """Go on as fast as it gets up to ``time_ps``, then hold; the time when that is.

        Whoever wants something else meanwhile ends it there. Raises ValueError for a past time,
        and where a debugger holds it.
        """
        if time_ps < self.kernel.now:
            now_s, wanted_s = self.kernel.now / PS_PER_S, time_ps / PS_PER_S
            raise ValueError(f"it is {now_s:.6f} s already, after {wanted_s:.6f} s")
        self._check_debugger()
        self._forget("sent elsewhere")
        self.kernel.hold(HOLDER)
        self._until_ps, self._arrived = time_ps, Future[int]()
        self._arrived.set_running_or_notify_cancel()  # who asked may be gone by then
        self._ring()
        return self._arrived

    def set_pace(self, mode: Mode, speed: float = 1.0) -> None:
        """See ``Pace.change``; ValueError for a speed out of range."""
        if not SLOWEST <= speed <= FASTEST:
            raise ValueError(f"a speed is {SLOWEST:g} to {FASTEST:g}, not {speed:g}")
        assert self.scheduler is not None
        self.scheduler.pace.change(mode, speed)

    # --- for the scheduler ----------------------------------------------------------------------

    def watched(self) -> list[tuple[int, int]]:
        """What is rung when there is something to do."""
        return [(self._hears, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """Do what has been asked for."""
        with suppress(BlockingIOError):
            os.read(self._hears, 1 << 16)
        while True:
            try:
                act = self._calls.get_nowait()
            except Empty:
                break
            act()
        self._go_on()

    def close(self) -> None:
        """Nothing can be asked for any more; who still waits is told."""
        with self._lock:
            self._closed = True
            os.close(self._hears)
            os.close(self._rings)
        self._forget("ended")
        for future in list(self._waiting):
            if future.set_running_or_notify_cancel():
                future.set_exception(RuntimeError(ENDED))

    def _go_on(self) -> None:
        """Towards the time that was asked for."""
        if self._until_ps is None:
            return
        self._release()
        end_ns = time.monotonic_ns() + SLICE_NS
        while self.kernel.now < self._until_ps and not self.held:
            horizon = self.kernel.horizon()
            if horizon is None or horizon >= self._until_ps:
                self.kernel.advance_to(self._until_ps)
                break
            self.kernel.step()
            if time.monotonic_ns() > end_ns:
                self.kernel.hold(HOLDER)
                self._ring()  # the other ports first, then more of it
                return
        self.kernel.hold(HOLDER)
        arrived, self._until_ps = self._arrived, None
        arrived.set_result(self.kernel.now)

    def _release(self) -> None:
        self.kernel.release(HOLDER)
        if self.scheduler is not None:
            self.scheduler.pace.align()

    def _check_debugger(self) -> None:
        others = self.kernel.holders - {HOLDER}
        if others:
            raise ValueError(f"{', '.join(sorted(others))} holds it: go on from there")

    def _forget(self, why: str) -> None:
        """End what was under way towards a time."""
        if self._until_ps is not None:
            self._until_ps = None
            self._arrived.set_exception(RuntimeError(f"it was {why} before it got there"))

    def _ring(self) -> None:
        with suppress(BlockingIOError):  # it has been rung thousands of times
            os.write(self._rings, b"\0")


def _settle(future: "Future[T]", act: Callable[[], T]) -> None:
    """Do what was asked for, unless nobody waits for it any more."""
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(act())
    except BaseException as error:  # for who asked
        future.set_exception(error)
