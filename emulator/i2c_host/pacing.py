"""Waiting for descriptors: not at all, or to the microsecond, as a byte takes 22.5 of them."""

import ctypes
import select
import struct

from cubestack.emulator.ports.pump import Watched

__all__ = ["poll_all", "sharpen_timers", "wait_precisely"]

PR_SET_TIMERSLACK = 29
NS_PER_S = 10**9

EARLY_S = 150e-6
"""Waking up takes that long on an idle machine; who is early asks again."""

_ENTRY = struct.Struct("=ihh")  # struct pollfd
_TIMEOUT = struct.Struct("=qq")  # struct timespec

_libc = ctypes.CDLL(None)
_libc.ppoll.argtypes = (ctypes.c_char_p, ctypes.c_ulong, ctypes.c_char_p, ctypes.c_void_p)


def sharpen_timers() -> None:
    """Ask the kernel to wake this process in time, not up to 50 us late as it usually does."""
    _libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def poll_all(watched: Watched) -> list[tuple[int, int]]:
    """Descriptors that are ready now, of those watched, with their events."""
    poller = select.poll()
    for fileno, events in watched:
        poller.register(fileno, events)
    return poller.poll(0)


def wait_precisely(watched: Watched, timeout_s: float) -> None:
    """Like the pump's ``wait_ready``, but never too late: it may end ``EARLY_S`` early."""
    wait_until(watched, max(0, int((timeout_s - EARLY_S) * NS_PER_S)))


def wait_until(watched: Watched, timeout_ns: int) -> None:
    """Wait until a descriptor is ready, or a signal comes, at most ``timeout_ns``."""
    entries = b"".join(_ENTRY.pack(fileno, events, 0) for fileno, events in watched)
    timeout = _TIMEOUT.pack(*divmod(timeout_ns, NS_PER_S))
    _libc.ppoll(entries, len(watched), timeout, None)
