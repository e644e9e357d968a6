"""Base class of the serial ports that other programs can open.

A serial port moves bytes between a client's descriptor and a UART line; neither side can flood it:

- A byte from the device goes to the present client at the time when it has arrived on the wire.
  The newest ``MAX_UNREAD`` bytes that a client does not read are kept here, in addition to the
  operating system's buffer. A client never receives bytes for an earlier client.
- While ``MAX_UNSENT`` bytes wait for the wire, further ones wait in the operating system, so a
  client that writes faster than the baud rate is slowed down, as by a real port.
"""

import select
from abc import abstractmethod

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.line import HostLine

MAX_UNREAD = 1 << 16
"""Bytes that wait for a slow client before the oldest are dropped."""

MAX_UNSENT = 4096
"""Bytes that may wait for the wire to the device: the size of Linux's serial buffer."""


class SerialPort(Endpoint):
    """The buffers, and the order of an exchange; subclasses have the descriptors.

    Attributes:
        overruns: how often bytes were dropped that the client did not read in time.
    """

    def __init__(self, uart: Uart) -> None:
        self._line = HostLine(uart)
        self._unread = bytearray()
        self._served: object = None
        self._plugged = True
        self.overruns = 0

    @property
    def congested(self) -> bool:
        """Whether bytes wait here for the client."""
        return bool(self._unread)

    def exchange(self, now_ps: int) -> None:
        """Move bytes from the client to the line while there is room, and back."""
        if not self._plugged:
            return
        while (room := self._room()) > 0 and (data := self._read(room)):
            self._line.uart.host_writes(data)
        arrived = self._line.take(now_ps)
        client = self._find_client()
        if client is None or client is not self._served:
            self._served = client
            self._unread.clear()
            return
        self._unread += arrived
        self.overruns += len(self._unread) > MAX_UNREAD
        del self._unread[:-MAX_UNREAD]
        if self._unread:
            del self._unread[: self._write(self._unread)]

    def pull(self) -> None:
        """Disconnect the line until ``plug``; clients stay, and what they write waits."""
        self._line.unplug()
        self._unread.clear()
        self._plugged = False

    def plug(self, uart: Uart) -> None:
        """Connect to another device's ``uart``; bytes that were on the wire are lost."""
        self._line.move(uart)
        self._plugged = True

    def release_ps(self, count: int) -> int | None:
        return self._line.arrival_ps(count)

    def close(self) -> None:
        self._line.unplug()

    def _room(self) -> int:
        return MAX_UNSENT - self._line.uart.host_backlog

    def _events(self, *, reading: bool) -> int:
        events = select.POLLIN if reading and self._room() > 0 else 0
        return events | (select.POLLOUT if self._unread else 0)

    @abstractmethod
    def _find_client(self) -> object | None:
        """Accept and drop clients; returns the present one, or None."""

    @abstractmethod
    def _read(self, max_bytes: int) -> bytes:
        """At most ``max_bytes`` that the client wrote; also from one that has gone since."""

    @abstractmethod
    def _write(self, data: bytearray) -> int:
        """Send ``data`` to the client; returns the number of bytes that it accepted."""
