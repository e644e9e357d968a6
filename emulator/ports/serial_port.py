"""What all serial ports that other programs can open have in common.

A serial port moves bytes between a client's descriptor and a UART line; neither side can flood it:

- What comes from the device is released when the wire would have delivered it, and goes to the
  client that is there then. Of what a client leaves unread, the newest ``MAX_UNREAD`` bytes wait
  here, behind what the operating system keeps for it. A client never gets what was released for
  the one before.
- What a client writes waits in the operating system while ``MAX_UNSENT`` bytes wait for the wire,
  so a client that writes faster than the baud rate is slowed down, as by a real port.
"""

import select
from abc import abstractmethod

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.line import HostLine

MAX_UNREAD = 1 << 16
"""Bytes that wait for a slow client before the oldest are dropped."""

MAX_UNSENT = 4096
"""Bytes that wait for the wire to the device: the size of Linux's own buffer of a serial port."""


class SerialPort(Endpoint):
    """The buffers, and the order of an exchange; a subclass knows the descriptors."""

    def __init__(self, uart: Uart) -> None:
        """Plug into ``uart``."""
        self._line = HostLine(uart)
        self._unread = bytearray()
        self._served: object = None
        self._plugged = True

    @property
    def congested(self) -> bool:
        """Whether released bytes wait here for the client."""
        return bool(self._unread)

    def exchange(self, now_ps: int) -> None:
        """Client to line as far as there is room; line to the client that is there."""
        if not self._plugged:
            return
        while (room := self._room()) > 0 and (data := self._read(room)):
            self._line.uart.host_writes(data)
        arrived = self._line.take(now_ps)
        client = self._look()
        if client is None or client is not self._served:
            self._served = client
            self._unread.clear()
            return
        self._unread += arrived
        del self._unread[:-MAX_UNREAD]
        if self._unread:
            del self._unread[: self._write(self._unread)]

    def pull(self) -> None:
        """Take the plug out: clients stay, and what they write waits, until ``plug``."""
        self._line.unplug()
        self._unread.clear()
        self._plugged = False

    def plug(self, uart: Uart) -> None:
        """Plug into another device's ``uart``; what was on the wire is lost."""
        self._line.move(uart)
        self._plugged = True

    def release_ps(self, count: int) -> int | None:
        """When the line has delivered the next ``count`` bytes, or all; None without any."""
        return self._line.arrival_ps(count)

    def close(self) -> None:
        """Take the line's plug out."""
        self._line.unplug()

    def _room(self) -> int:
        return MAX_UNSENT - self._line.uart.host_backlog

    def _events(self, *, reading: bool) -> int:
        """Events to wait for on the client's descriptor."""
        events = select.POLLIN if reading and self._room() > 0 else 0
        return events | (select.POLLOUT if self._unread else 0)

    @abstractmethod
    def _look(self) -> object | None:
        """Notice clients that came and went; the one that is there now, None without one."""

    @abstractmethod
    def _read(self, max_bytes: int) -> bytes:
        """What the client wrote, as far as it is there; also a client that has gone since."""

    @abstractmethod
    def _write(self, data: bytearray) -> int:
        """Hand ``data`` to the client; returns how many bytes it could take."""
