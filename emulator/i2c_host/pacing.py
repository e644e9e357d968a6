"""Waiting for descriptors: not at all, or to the microsecond, as a byte takes 22.5 of them."""

import ctypes
import os
import select
import struct
import time
from collections.abc import Sequence

from cubestack.emulator.ports.pump import Watched
from cubestack.emulator.ports.serial_port import Endpoint

__all__ = ["Watch", "sharpen_timers", "wait_precisely"]

PR_SET_TIMERSLACK = 29
NS_PER_S = 10**9

EARLY_S = 150e-6
"""Waking up takes that long on an idle machine; who is early asks again."""

NAP_NS = 50_000
"""What it takes at most on a busy one, with real-time priority."""

_ENTRY = struct.Struct("=ihh")  # struct pollfd
_TIMEOUT = struct.Struct("=qq")  # struct timespec

_libc = ctypes.CDLL(None)
_libc.ppoll.argtypes = (ctypes.c_char_p, ctypes.c_ulong, ctypes.c_char_p, ctypes.c_void_p)


class Watch:
    """Waits for ports, mostly for the same ones again and again."""

    def __init__(self, ports: Sequence[Endpoint]) -> None:
        """Watch ``ports``."""
        self._ports = ports
        self._poller = select.epoll()
        self._watched: dict[int, Endpoint] = {}
        # Then nobody of less importance gets the processor while we wait awake.
        self._first = os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR)

    def wait(self, timeout_ns: int, *, awake: bool = False) -> list[Endpoint]:
        """Wait until some are ready, or a signal comes, at most ``timeout_ns``; which are ready.

        With ``awake``, waking up may not take time, if this process has real-time priority.
        """
        watched = {fileno: port for port in self._ports for fileno, _ in port.watched()}
        if watched != self._watched:
            self._change(watched)
        if awake and self._first:
            end_ns = time.monotonic_ns() + timeout_ns
            while not (ready := self._poller.poll(0)) and time.monotonic_ns() < end_ns:
                os.sched_yield()
        else:
            ready = self._poller.poll(timeout_ns / NS_PER_S)
        return [watched[fileno] for fileno, _ in ready]

    def _change(self, watched: dict[int, Endpoint]) -> None:
        for fileno in self._watched.keys() - watched.keys():
            self._poller.unregister(fileno)
        for fileno in watched.keys() - self._watched.keys():
            self._poller.register(fileno, select.EPOLLIN)
        self._watched = watched

    def nap(self, duration_ns: int) -> None:
        """Sleep less than ``duration_ns``, where waking up is quick."""
        if self._first and duration_ns > NAP_NS:
            time.sleep((duration_ns - NAP_NS) / NS_PER_S)

    def close(self) -> None:
        """Watch no longer; the ports are their owner's."""
        self._poller.close()


def sharpen_timers() -> None:
    """Ask the kernel to wake this process in time, not up to 50 us late as it usually does."""
    _libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def wait_precisely(watched: Watched, timeout_s: float) -> None:
    """Like the pump's ``wait_ready``, but never too late: it may end ``EARLY_S`` early."""
    entries = b"".join(_ENTRY.pack(fileno, events, 0) for fileno, events in watched)
    timeout_ns = max(0, int((timeout_s - EARLY_S) * NS_PER_S))
    _libc.ppoll(entries, len(watched), _TIMEOUT.pack(*divmod(timeout_ns, NS_PER_S)), None)
