"""Serial ports that other programs can open: a pseudo-terminal with a stable name, a TCP socket.

A port moves bytes between a client's descriptor and a UART line, and neither side can flood it:

- What comes from the device is released when the wire would have delivered it, and goes to the
  client that is there then. Of what a client leaves unread the newest ``MAX_UNREAD`` bytes wait
  here, after what the operating system keeps for it. A client never gets what was meant for the
  one before.
- What a client writes waits in the operating system while ``MAX_UNSENT`` bytes wait for the wire,
  so a client that writes faster than the baud rate is slowed down, as by a real port.
"""

import contextlib
import errno
import fcntl
import ipaddress
import os
import pty
import select
import socket
import termios
import tty
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol

from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.uart import Uart

__all__ = ["MAX_UNREAD", "MAX_UNSENT", "Endpoint", "PortError", "PtyEndpoint", "TcpEndpoint"]

MAX_UNREAD = 1 << 16
"""Bytes that wait for a slow client before the oldest are dropped."""

MAX_UNSENT = 4096
"""Bytes that wait for the wire to the device: the size of Linux's own buffer of a serial port."""

TCP_RECEIVE_BUFFER = 4096
"""Bytes. Small, so that little of a client that floods the port and dies is still delivered."""


class PortError(OSError):
    """A port can not be opened; the text names it and what would be right."""


class Endpoint(Protocol):
    """A port that the pump serves."""

    name: str

    @property
    def congested(self) -> bool:
        """Whether the client reads more slowly than the device's output is released."""

    def watched(self) -> list[tuple[int, int]]:
        """Descriptors and the events of ``select.poll`` that should wake the pump."""

    def exchange(self, now_ps: int) -> None:
        """Move what can be moved at virtual time ``now_ps``, without blocking."""

    def next_release_ps(self) -> int | None:
        """When the next byte from the device arrives at the host; None without one."""

    def last_release_ps(self) -> int | None:
        """When the last byte that the device has sent so far arrives; None without one."""

    def close(self) -> None:
        """Release the port."""


class _SerialPort(ABC):
    """What the ports have in common: buffers, and the order of an exchange."""

    name: str

    def __init__(self, uart: Uart) -> None:
        self._line = HostLine(uart)
        self._unread = bytearray()

    @property
    def congested(self) -> bool:
        """See Endpoint."""
        return bool(self._unread)

    def exchange(self, now_ps: int) -> None:
        """See Endpoint."""
        while (room := self._room()) > 0 and (data := self._read(room)):
            self._line.write(data)
        if not self._client_present():
            self._unread.clear()
            self._line.take(now_ps)
            return
        self._unread += self._line.take(now_ps)
        del self._unread[:-MAX_UNREAD]
        if self._unread:
            del self._unread[: self._write(self._unread)]

    def next_release_ps(self) -> int | None:
        """See Endpoint."""
        return self._line.next_arrival_ps

    def last_release_ps(self) -> int | None:
        """See Endpoint."""
        return self._line.last_arrival_ps

    def close(self) -> None:
        """See Endpoint."""
        self._line.unplug()

    def _room(self) -> int:
        return MAX_UNSENT - self._line.write_backlog

    def _events(self, *, reading: bool) -> int:
        """Events to wait for on the client's descriptor."""
        events = select.POLLIN if reading and self._room() > 0 else 0
        return events | (select.POLLOUT if self._unread else 0)

    @abstractmethod
    def _client_present(self) -> bool:
        """Notice clients that came and went; whether there is one now."""

    @abstractmethod
    def _read(self, max_bytes: int) -> bytes:
        """What the client wrote, as far as it is there; also a client that has gone since."""

    @abstractmethod
    def _write(self, data: bytearray) -> int:
        """Hand ``data`` to the client; returns how many bytes it could take."""


class PtyEndpoint(_SerialPort):
    """A pseudo-terminal whose slave is reachable under a symbolic link.

    A client is there while any program has the slave open. When the last one closes, what was not
    read is dropped, raw mode is restored and exclusive use ends, so the next client finds the port
    like new; bytes from the device that nobody is there for are dropped as well. The pump notices
    the end at once and the beginning at its next look. A client that closes and opens again
    before the pump gets a look in is taken for one that stayed.
    """

    def __init__(self, path: Path, uart: Uart) -> None:
        """Open it; ``path`` must be free or a stale link of an earlier run, else PortError."""
        if path.is_symlink() and not path.exists():
            path.unlink()
        if path.is_symlink() or path.exists():
            raise PortError(f"{path} exists already: choose another --pty path or remove it")
        self._master, self._terminal = _open_terminal()
        self._raw = termios.tcgetattr(self._master)
        self._path = path
        self.name = str(path)
        try:
            path.symlink_to(self._terminal)
        except OSError as error:
            os.close(self._master)
            raise PortError(f"can not make the link {path}: {error.strerror}") from error
        self._connected = False
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        """See Endpoint; nothing without a client, as a hung-up master is always ready."""
        return [(self._master, self._events(reading=True))] if self._connected else []

    def close(self) -> None:
        """Remove the link, if it is still ours, and the terminal."""
        super().close()
        with contextlib.suppress(OSError):
            if self._path.readlink() == Path(self._terminal):
                self._path.unlink()
        os.close(self._master)

    def _client_present(self) -> bool:
        hung_up = _poll(self._master, 0) & select.POLLHUP
        # A client may come and go between two looks, and leave other settings.
        if hung_up and (self._connected or termios.tcgetattr(self._master) != self._raw):
            self._renew()
        self._connected = not hung_up
        return self._connected

    def _read(self, max_bytes: int) -> bytes:
        try:
            return os.read(self._master, max_bytes)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:  # hung up, and nothing is left
                return b""
            raise

    def _write(self, data: bytearray) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def _renew(self) -> None:
        """Undo what the last client left behind."""
        try:
            slave = os.open(self._terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            # Locked by TIOCEXCL, which outlives its client: only a new terminal helps.
            self._replace()
            return
        fcntl.ioctl(slave, termios.TIOCNXCL)
        tty.setraw(slave)
        termios.tcflush(slave, termios.TCIFLUSH)
        os.close(slave)

    def _replace(self) -> None:
        """Put a new terminal under the same link."""
        master, self._terminal = _open_terminal()
        os.dup2(master, self._master, inheritable=False)
        os.close(master)
        new_link = self._path.with_name(f".{self._path.name}.new")
        new_link.symlink_to(self._terminal)
        new_link.replace(self._path)


class TcpEndpoint(_SerialPort):
    """A listening socket that serves one client at a time; a second one is refused with a line.

    A client that has shut down or closed its side still gets the device's output while it takes
    any, but makes room for the next one, and what it sent last is lost if the wire was too slow.
    """

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port`` (port 0: any free one).

        Args:
            host: address or name of this machine's interface.
            port: 0..65535.
            uart: the serial line.
            allow_remote: permit addresses that other machines can reach; there is no protection.

        Raises:
            PortError: the address is unknown, taken, or not a loopback address.
        """
        self._server = _listen(host, port, allow_remote=allow_remote)
        self._client: socket.socket | None = None
        self._input_ended = False
        self.address: tuple[str, int] = self._server.getsockname()[:2]
        name = f"[{self.address[0]}]" if ":" in self.address[0] else self.address[0]
        self.name = f"tcp://{name}:{self.address[1]}"
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        """See Endpoint: the server socket, and the client's while it can do something."""
        watched = [(self._server.fileno(), select.POLLIN)]
        if self._client is not None:
            # Without an event to wait for, a client that has gone would still be reported.
            events = self._events(reading=not self._input_ended)
            if events:
                watched.append((self._client.fileno(), events))
        return watched

    def close(self) -> None:
        """Drop the client and stop listening."""
        super().close()
        self._drop()
        self._server.close()

    def _client_present(self) -> bool:
        try:
            newcomer = self._server.accept()[0]
        except OSError:  # nobody, or gone again
            return self._client is not None
        newcomer.setblocking(False)
        if self._client is not None and not self._leaving(self._client):
            with contextlib.suppress(OSError):
                newcomer.send(b"cubestack: this port has a client already\r\n")
            newcomer.close()
            return True
        self._drop()
        newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = newcomer
        return True

    def _leaving(self, client: socket.socket) -> bool:
        gone = select.POLLRDHUP | select.POLLHUP | select.POLLERR
        return bool(_poll(client.fileno(), select.POLLRDHUP) & gone)

    def _read(self, max_bytes: int) -> bytes:
        if self._client is None or self._input_ended:
            return b""
        try:
            data = self._client.recv(max_bytes)
        except BlockingIOError:
            return b""
        except OSError:
            self._drop()
            return b""
        self._input_ended = not data
        return data

    def _write(self, data: bytearray) -> int:
        assert self._client is not None
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop()
            return len(data)

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None
        self._input_ended = False
        self._unread.clear()


def _open_terminal() -> tuple[int, str]:
    """Open a raw pseudo-terminal: its master, and the path of its slave, which is closed."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    os.close(slave)
    os.set_blocking(master, False)
    return master, path


def _listen(host: str, port: int, *, allow_remote: bool) -> socket.socket:
    if not 0 <= port <= 0xFFFF:
        raise PortError(f"TCP port {port} is not in 0..65535")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        if not allow_remote and not ipaddress.ip_address(address[0]).is_loopback:
            raise PortError(
                f"{host} can be reached from other machines: listen on 127.0.0.1 or allow it"
            )
        server = socket.create_server((address[0], port), family=family)
    except PortError:
        raise
    except OSError as error:
        raise PortError(
            f"can not listen on {host}:{port}: {error.strerror}; choose another --tcp port"
        ) from error
    server.setblocking(False)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TCP_RECEIVE_BUFFER)
    return server


def _poll(fileno: int, events: int) -> int:
    """Events of one descriptor now, POLLHUP and POLLERR always among them."""
    poller = select.poll()
    poller.register(fileno, events)
    ready = poller.poll(0)
    return ready[0][1] if ready else 0
