"""Waiting to the microsecond, for a bus on which a byte takes 22.5 of them."""

import ctypes
import select

from cubestack.emulator.ports.pump import Watched, wait_ready

__all__ = ["sharpen_timers", "wait_precisely"]

PR_SET_TIMERSLACK = 29
MOST_DESCRIPTOR = 1023
"""Largest number that select can wait for."""


def sharpen_timers() -> None:
    """Ask the kernel to wake this process in time, not up to 50 us late as it usually does."""
    ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def wait_precisely(watched: Watched, timeout_s: float) -> None:
    """Like ``wait_ready``, to the microsecond while descriptors have the numbers that allow it."""
    if any(fileno > MOST_DESCRIPTOR for fileno, _ in watched):
        wait_ready(watched, timeout_s)
        return
    reading = [fileno for fileno, events in watched if not events or events & select.POLLIN]
    writing = [fileno for fileno, events in watched if events & select.POLLOUT]
    select.select(reading, writing, [], timeout_s)
