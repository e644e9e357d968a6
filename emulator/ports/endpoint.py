"""What a port is that other programs can open."""

import select
from abc import ABC, abstractmethod

HUNG_UP: int = getattr(select, "POLLRDHUP", select.POLLHUP)
"""Event of a client that sends nothing more; where there is none, of one that has gone."""


class PortError(OSError):
    """A port can not be opened; the text names it and what would be right."""


class Endpoint(ABC):
    """A port that a scheduler serves.

    Attributes:
        name: for messages.
    """

    name: str

    @property
    def congested(self) -> bool:
        """Whether the client reads more slowly than the device's output is released."""
        return False

    def watched(self) -> list[tuple[int, int]]:
        """Descriptors and the events of ``select.poll`` that should wake the scheduler."""
        return []

    @abstractmethod
    def exchange(self, now_ps: int) -> None:
        """Move what can be moved at virtual time ``now_ps``, without blocking."""

    def release_ps(self, count: int) -> int | None:
        """When the next ``count`` bytes from the device, or all, have arrived; None without any."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the port."""


def poll_now(fileno: int, events: int) -> int:
    """Events of one descriptor now, POLLHUP and POLLERR always among them."""
    poller = select.poll()
    poller.register(fileno, events)
    ready = poller.poll(0)
    return ready[0][1] if ready else 0
