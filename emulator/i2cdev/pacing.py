"""Waits for descriptors to the microsecond, as a byte on the bus takes 22.5 us."""

import ctypes
import os
import select
import struct
import time
from collections.abc import Sequence
from functools import cache

from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.realtime import Watched

PR_SET_TIMERSLACK = 29
NS_PER_S = 10**9

EARLY_S = 150e-6
"""Time to wake up on an idle machine; a caller that wakes early waits again."""

NAP_NS = 50_000
"""Longest time to wake up on a busy machine with real-time priority."""

CROWDED_NS = 300_000
"""Duration of a yield from which the processor counts as shared with other processes."""

ALONE_AGAIN_NS = NS_PER_S
"""After that, a process without priority does not busy-wait for this time."""

_ENTRY = struct.Struct("=ihh")  # struct pollfd
_TIMEOUT = struct.Struct("=qq")  # struct timespec


@cache
def _libc() -> ctypes.CDLL:
    """The C library; loaded late, as only Linux's has these functions."""
    library = ctypes.CDLL(None)
    library.ppoll.argtypes = (ctypes.c_char_p, ctypes.c_ulong, ctypes.c_char_p, ctypes.c_void_p)
    return library


class Watch:
    """Waits for ports; fast when these are mostly the same ones."""

    def __init__(self, ports: Sequence[Endpoint], *, always_asleep: bool = False) -> None:
        """Watch ``ports``; ``always_asleep`` disables busy-waiting, if callers wake us quickly."""
        self._ports = ports
        self._poller = select.epoll()
        self._watched: dict[int, Endpoint] = {}
        self._always_asleep = always_asleep
        # With priority, no other process takes the processor while we busy-wait.
        self._has_priority = has_priority()
        self._crowded_until_ns = 0

    def wait(self, timeout_ns: int, *, awake: bool = False) -> list[Endpoint]:
        """Wait until ports are ready, or a signal comes, at most ``timeout_ns``; the ready ports.

        With ``awake``, it busy-waits, if this process has real-time priority or the processor to
        itself.
        """
        watched = {fileno: port for port in self._ports for fileno, _ in port.watched()}
        if watched != self._watched:
            self._change(watched)
        now_ns = time.monotonic_ns()
        end_ns = now_ns + timeout_ns
        ready: list[tuple[int, int]] = []
        if awake and not self._always_asleep:
            while (self._has_priority or now_ns >= self._crowded_until_ns) and now_ns < end_ns:
                if ready := self._poller.poll(0):
                    break
                os.sched_yield()
                before_ns, now_ns = now_ns, time.monotonic_ns()
                if now_ns - before_ns > CROWDED_NS:
                    self._crowded_until_ns = now_ns + ALONE_AGAIN_NS
        if not ready:
            ready = self._poller.poll(max(0, end_ns - now_ns) / NS_PER_S)
        return [watched[fileno] for fileno, _ in ready]

    def _change(self, watched: dict[int, Endpoint]) -> None:
        for fileno in self._watched.keys() - watched.keys():
            self._poller.unregister(fileno)
        for fileno in watched.keys() - self._watched.keys():
            self._poller.register(fileno, select.EPOLLIN)
        self._watched = watched

    def nap(self, duration_ns: int) -> None:
        """Sleep for less than ``duration_ns``, if waking up is fast."""
        if self._has_priority and duration_ns > NAP_NS:
            time.sleep((duration_ns - NAP_NS) / NS_PER_S)

    def close(self) -> None:
        self._poller.close()


def has_priority() -> bool:
    return os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR)


def sharpen_timers() -> None:
    """Have the kernel wake this process in time, not up to 50 us late as by default."""
    _libc().prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def wait_precisely(watched: Watched, timeout_s: float) -> None:
    """As ``realtime.wait_ready``, but never late: it may end ``EARLY_S`` early."""
    entries = b"".join(_ENTRY.pack(fileno, events, 0) for fileno, events in watched)
    timeout_ns = max(0, int((timeout_s - EARLY_S) * NS_PER_S))
    _libc().ppoll(entries, len(watched), _TIMEOUT.pack(*divmod(timeout_ns, NS_PER_S)), None)
