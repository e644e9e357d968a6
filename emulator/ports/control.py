"""A port through which other threads control a running emulation.

Calls run in the emulation's thread, between two of its events, so they never see a partial event.
While virtual time is held, a change takes effect when time continues: permanently, for a number of
events, or up to a given time.
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

SLICE_NS = 20_000_000
"""Wall time that ``run_to`` takes before the other ports are served."""

MOST_EVENTS = 100_000
"""Limit of one step: some seconds of wall time."""

FASTEST, SLOWEST = 1000.0, 0.001

ENDED = "the emulation has ended"

T = TypeVar("T")


class ControlPort(Endpoint):
    """The port; its creator must set ``scheduler`` to the scheduler that serves it."""

    name = "control"

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.scheduler: RealtimeScheduler | None = None
        self._calls = SimpleQueue[Callable[[], None]]()
        self._wake_reader, self._wake_writer = os.pipe()
        os.set_blocking(self._wake_reader, False)
        os.set_blocking(self._wake_writer, False)
        self._until_ps: int | None = None
        self._arrived = Future[int]()
        self._waiting = set[Future[Any]]()
        self._lock = Lock()
        self._closed = False

    # --- called by any thread -------------------------------------------------------------------

    def call(self, act: Callable[[], T]) -> "Future[T]":
        """Run ``act`` between two events; RuntimeError if the emulation has ended."""
        future = Future[T]()
        with self._lock:
            if self._closed:
                future.set_exception(RuntimeError(ENDED))
            else:
                self._calls.put(partial(_run_call, future, act))
                self._waiting.add(future)
                self._wake()
        future.add_done_callback(self._waiting.discard)
        return future

    # --- called within ``call`` -----------------------------------------------------------------

    @property
    def held(self) -> bool:
        return self.kernel.paused

    def pause(self) -> None:
        self._cancel_run("held")
        self.kernel.hold(HOLDER)

    def resume(self) -> None:
        self._cancel_run("resumed")
        self._release()

    def step(self, events: int = 1) -> int:
        """Run ``events`` events, then hold; returns their number, fewer if there are no more.

        Raises ValueError for a number outside 1..``MOST_EVENTS``, and while a debugger holds time.
        """
        if not 1 <= events <= MOST_EVENTS:
            raise ValueError(f"a step is 1 to {MOST_EVENTS} events, not {events}")
        self._check_debugger()
        self._cancel_run("stepped")
        self._release()
        done = 0
        while done < events and self.kernel.horizon() is not None and not self.held:
            self.kernel.step()
            done += 1
        self.kernel.hold(HOLDER)
        return done

    def run_to(self, time_ps: int) -> "Future[int]":
        """Run as fast as possible up to ``time_ps``, then hold; the future returns the time.

        Any other command cancels the run. Raises ValueError for a past time, and while a debugger
        holds time.
        """
        if time_ps < self.kernel.now:
            now_s, wanted_s = self.kernel.now / PS_PER_S, time_ps / PS_PER_S
            raise ValueError(f"can not run to {wanted_s:.6f} s: the time is already {now_s:.6f} s")
        self._check_debugger()
        self._cancel_run("replaced by another run")
        self.kernel.hold(HOLDER)
        self._until_ps, self._arrived = time_ps, Future[int]()
        self._arrived.set_running_or_notify_cancel()  # the caller may be gone by then
        self._wake()
        return self._arrived

    def set_pace(self, mode: Mode, speed: float = 1.0) -> None:
        """Change pace and speed, see ``Pace.change``; ValueError for a speed out of range."""
        if not SLOWEST <= speed <= FASTEST:
            raise ValueError(f"a speed is {SLOWEST:g} to {FASTEST:g}, not {speed:g}")
        assert self.scheduler is not None
        self.scheduler.pace.change(mode, speed)

    # --- called by the scheduler ----------------------------------------------------------------

    def watched(self) -> list[tuple[int, int]]:
        return [(self._wake_reader, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """Run the queued calls, and continue a ``run_to``."""
        with suppress(BlockingIOError):
            os.read(self._wake_reader, 1 << 16)
        while True:
            try:
                act = self._calls.get_nowait()
            except Empty:
                break
            act()
        self._continue_run()

    def close(self) -> None:
        """Reject further calls; pending ones raise RuntimeError."""
        with self._lock:
            self._closed = True
            os.close(self._wake_reader)
            os.close(self._wake_writer)
        self._cancel_run("ended")
        for future in list(self._waiting):
            if future.set_running_or_notify_cancel():
                future.set_exception(RuntimeError(ENDED))

    def _continue_run(self) -> None:
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
                self._wake()  # continue after the other ports were served
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
            raise ValueError(f"held by the {', '.join(sorted(others))}; continue from there")

    def _cancel_run(self, why: str) -> None:
        if self._until_ps is not None:
            self._until_ps = None
            self._arrived.set_exception(RuntimeError(f"the run was {why} before its end"))

    def _wake(self) -> None:
        with suppress(BlockingIOError):  # the pipe is full of wake-ups already
            os.write(self._wake_writer, b"\0")


def _run_call(future: "Future[T]", act: Callable[[], T]) -> None:
    """Run ``act``, unless the caller has cancelled ``future``."""
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(act())
    except BaseException as error:  # raised in the caller
        future.set_exception(error)
