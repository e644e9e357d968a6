"""Serial ports that other programs can open: a pseudo-terminal with a stable name, a TCP socket.

An endpoint moves bytes between a file descriptor and a UART line. What comes from the device is
released when the wire would have delivered it; what a client never read is dropped when the next
client opens.
"""

import contextlib
import errno
import os
import pty
import select
import socket
import tty
from collections import deque
from pathlib import Path
from typing import Protocol

from cubestack.emulator.uart import Uart

__all__ = ["Endpoint", "PortError", "PtyEndpoint", "TcpEndpoint"]

READ_CHUNK = 4096
CLIENT_BACKLOG = 1 << 16
"""Bytes that a slow client may leave unread before the oldest are dropped."""


class PortError(OSError):
    """A port can not be opened; the text names it and what would be right."""


class Endpoint(Protocol):
    """A port that the pump serves."""

    name: str

    def filenos(self) -> list[int]:
        """Descriptors whose readability should wake the pump."""

    def exchange(self, now_ps: int) -> None:
        """Move what can be moved at virtual time ``now_ps``, without blocking."""

    def next_release_ps(self) -> int | None:
        """When the next byte from the device has arrived at the host; None without one."""

    def close(self) -> None:
        """Release the port."""


class _Line:
    """The device's output with arrival times, and a bounded backlog for the client."""

    def __init__(self, uart: Uart) -> None:
        self._blocks: deque[tuple[bytes, int, int]] = deque()
        self.backlog = bytearray()
        self._uart = uart
        uart.line = lambda data, first, step: self._blocks.append((data, first, step))

    def release(self, now_ps: int) -> None:
        while self._blocks:
            data, first_ps, byte_ps = self._blocks[0]
            arrived = (now_ps - first_ps) // byte_ps + 1
            if arrived <= 0:
                break
            self.backlog += data[:arrived]
            self._blocks.popleft()
            if arrived < len(data):
                self._blocks.appendleft((data[arrived:], first_ps + arrived * byte_ps, byte_ps))
                break
        del self.backlog[:-CLIENT_BACKLOG]

    def next_release_ps(self) -> int | None:
        return self._blocks[0][1] if self._blocks else None

    def to_device(self, data: bytes) -> None:
        self._uart.host_writes(data)


class PtyEndpoint:
    """A pseudo-terminal whose slave is reachable under a symbolic link."""

    def __init__(self, path: Path, uart: Uart) -> None:
        """Open it; ``path`` must be free or a stale link of an earlier run, else PortError."""
        if path.is_symlink() and not path.exists():
            path.unlink()
        if path.is_symlink() or path.exists():
            raise PortError(f"{path} exists already: choose another --pty path or remove it")
        self._line = _Line(uart)
        # The slave stays open here too: with no open slave the master reports a hang-up for ever.
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._path = path
        self.name = str(path)
        try:
            path.symlink_to(os.ttyname(self._slave))
        except OSError as error:
            self._close_descriptors()
            raise PortError(f"can not make the link {path}: {error.strerror}") from error

    def filenos(self) -> list[int]:
        """The master side."""
        return [self._master]

    def exchange(self, now_ps: int) -> None:
        """Move bytes both ways."""
        with contextlib.suppress(BlockingIOError):
            while data := os.read(self._master, READ_CHUNK):
                self._line.to_device(data)
        self._line.release(now_ps)
        if self._line.backlog:
            with contextlib.suppress(BlockingIOError):
                written = os.write(self._master, self._line.backlog)
                del self._line.backlog[:written]

    def next_release_ps(self) -> int | None:
        """See Endpoint."""
        return self._line.next_release_ps()

    def _close_descriptors(self) -> None:
        os.close(self._master)
        os.close(self._slave)

    def close(self) -> None:
        """Remove the link and the terminal."""
        self._path.unlink(missing_ok=True)
        self._close_descriptors()


class TcpEndpoint:
    """A listening socket that serves one client at a time; a second one is refused with a line."""

    def __init__(self, host: str, port: int, uart: Uart) -> None:
        """Listen on ``host``:``port`` (port 0: any free one); raises PortError when it is taken."""
        self._line = _Line(uart)
        try:
            self._server = socket.create_server((host, port))
        except OSError as error:
            raise PortError(
                f"can not listen on {host}:{port}: {error.strerror}; choose another --tcp port"
            ) from error
        self._server.setblocking(False)
        self._client: socket.socket | None = None
        self.address: tuple[str, int] = self._server.getsockname()[:2]
        self.name = f"tcp://{self.address[0]}:{self.address[1]}"

    def filenos(self) -> list[int]:
        """The server socket and the client's."""
        return [self._server.fileno(), *([self._client.fileno()] if self._client else [])]

    def exchange(self, now_ps: int) -> None:
        """Accept or refuse clients, then move bytes both ways."""
        with contextlib.suppress(BlockingIOError):
            while True:
                self._welcome(self._server.accept()[0])
        if self._client is not None:
            self._receive(self._client)
        self._line.release(now_ps)
        if self._client is None:
            self._line.backlog.clear()
        elif self._line.backlog:
            try:
                del self._line.backlog[: self._client.send(self._line.backlog)]
            except BlockingIOError:
                pass
            except OSError:
                self._drop()

    def _welcome(self, client: socket.socket) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError):
                client.sendall(b"cubestack: this port has a client already\r\n")
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        self._line.backlog.clear()

    def _receive(self, client: socket.socket) -> None:
        try:
            while data := client.recv(READ_CHUNK):
                self._line.to_device(data)
            self._drop()
        except BlockingIOError:
            pass
        except OSError:
            self._drop()

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def next_release_ps(self) -> int | None:
        """See Endpoint."""
        return self._line.next_release_ps()

    def close(self) -> None:
        """Stop listening."""
        self._drop()
        self._server.close()


def wait_readable(filenos: list[int], timeout_s: float) -> None:
    """Sleep until one of ``filenos`` has input, at most ``timeout_s`` of wall time."""
    try:
        select.select(filenos, [], [], timeout_s)
    except OSError as error:
        if error.errno != errno.EBADF:
            raise
