"""Base class of the ports that a scheduler serves."""

import os
import select
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress

HUNG_UP: int = getattr(select, "POLLRDHUP", select.POLLHUP)
"""Event of a client that has shut down its side; on other systems, of one that has closed."""


class PortError(OSError):
    """A port can not be opened; the text names the port and a remedy."""


class Endpoint(ABC):
    """A port that a scheduler serves."""

    name: str  # name in messages

    @property
    def congested(self) -> bool:
        """Whether the client reads more slowly than the device's output arrives."""
        return False

    def watched(self) -> list[tuple[int, int]]:
        """Descriptors and the events of ``select.poll`` that should wake the scheduler."""
        return []

    @abstractmethod
    def exchange(self, now_ps: int) -> None:
        """Send and receive what is possible at virtual time ``now_ps``, without blocking."""

    def release_ps(self, count: int) -> int | None:
        """When the next ``count`` bytes from the device, or all, have arrived; None without any."""
        return None

    @abstractmethod
    def close(self) -> None: ...


def poll_now(fileno: int, events: int) -> int:
    """Current events of one descriptor; POLLHUP and POLLERR are always included."""
    poller = select.poll()
    poller.register(fileno, events)
    ready = poller.poll(0)
    return ready[0][1] if ready else 0


class Lifeline(Endpoint):
    """The reading end of a pipe whose other end the parent process holds open.

    It ends an emulation when the process that started it ends, in whatever way.
    """

    name = "lifeline"

    def __init__(self, descriptor: int) -> None:
        """Watch ``descriptor``, and own it; OSError for an invalid one."""
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self.on_end: Callable[[], None] = lambda: None
        self._ended = False

    def watched(self) -> list[tuple[int, int]]:
        return [] if self._ended else [(self._descriptor, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """Call ``on_end`` if the other end was closed."""
        with suppress(BlockingIOError):
            if not self._ended and not os.read(self._descriptor, 1 << 12):
                self._ended = True
                self.on_end()

    def close(self) -> None:
        os.close(self._descriptor)
