"""A serial port of the emulator that other programs open as a TCP socket."""

import contextlib
import ipaddress
import os
import select
import socket

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import HUNG_UP, PortError, poll_now
from cubestack.emulator.ports.serial_port import SerialPort

TCP_RECEIVE_BUFFER = 4096
"""Bytes. Small, so that little is left to deliver of a client that floods the port and ends."""

MAX_AHEAD = 8 << 20
"""Bytes, more than a sender's buffer of Linux holds (tcp(7), tcp_wmem)."""

MAX_AHEAD_AT_ONCE = 1 << 14
"""Bytes of a flood that are read between two turns of the device."""

REFUSAL = b"cubestack: this port has a client already\r\n"
"""Plain text, which contains no frame and no telnet command."""


class TcpEndpoint(SerialPort):
    """A listening socket that serves one client at a time; a second one is refused with a line.

    A client that has shut down its side still receives the device's output, but a new client
    replaces it; bytes that the old one sent last are lost if the wire was too slow for them. Its
    end may be behind bytes that the wire has no time for, so they are read when a new client comes,
    which waits meanwhile.
    """

    scheme = "tcp"

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port`` (port 0: any free one).

        Args:
            host: address or name of this machine's interface.
            port: 0..65535.
            uart: the serial line.
            allow_remote: permit addresses that other machines can reach; there is no protection.

        Raises:
            PortError: the address is unknown, in use, or not a loopback address.
        """
        self._server = listen(host, port, allow_remote=allow_remote)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TCP_RECEIVE_BUFFER)
        self._client: socket.socket | None = None
        self._newcomer: socket.socket | None = None
        self._input_ended = False
        self._ahead = bytearray()  # read before the wire had room
        self.address: tuple[str, int] = self._server.getsockname()[:2]
        name = f"[{self.address[0]}]" if ":" in self.address[0] else self.address[0]
        self.name = f"{self.scheme}://{name}:{self.address[1]}"
        super().__init__(uart)

    def watched(self) -> list[tuple[int, int]]:
        watched = [] if self._newcomer else [(self._server.fileno(), select.POLLIN)]
        if self._client is not None:
            # Even with no events to wait for, poll would report a client that has gone.
            events = self._events(reading=not self._input_ended)
            if self._newcomer is not None:
                events |= select.POLLIN
            if self._ahead and self._room() > 0:
                events |= select.POLLOUT  # at once
            if events:
                watched.append((self._client.fileno(), events))
        return watched

    def close(self) -> None:
        super().close()
        self._drop()
        if self._newcomer is not None:
            self._newcomer.close()
        self._server.close()

    def _find_client(self) -> object | None:
        newcomer, self._newcomer = self._newcomer or self._accept(), None
        if newcomer is None:
            return self._client
        if self._client is not None and not self._gone(self._client):
            if self._read_ahead(self._client):
                self._newcomer = newcomer
                return self._client
            if not self._gone(self._client):
                with contextlib.suppress(OSError):
                    newcomer.send(REFUSAL)
                newcomer.close()
                return self._client
        self._drop()
        newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = newcomer
        self._welcome()
        return self._client

    def _accept(self) -> socket.socket | None:
        try:
            newcomer = self._server.accept()[0]
        except OSError:  # no client, or it has gone again
            return None
        newcomer.setblocking(False)
        return newcomer

    @staticmethod
    def _gone(client: socket.socket) -> bool:
        """Whether the client has shut down its side, and all that it sent is here."""
        # poll reports hang-ups and errors in any case.
        return bool(poll_now(client.fileno(), HUNG_UP))

    def _read_ahead(self, client: socket.socket) -> bool:
        """Read a part of what the client has sent; returns whether there can be more."""
        left = min(MAX_AHEAD_AT_ONCE, MAX_AHEAD - len(self._ahead))
        with contextlib.suppress(OSError):
            while left > 0 and (data := client.recv(left)):
                self._ahead += data
                left -= len(data)
        return left == 0 and len(self._ahead) < MAX_AHEAD

    def _welcome(self) -> None: ...

    def _read(self, max_bytes: int) -> bytes:
        if self._ahead:
            data = bytes(self._ahead[:max_bytes])
            del self._ahead[:max_bytes]
            return data
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
        self._ahead.clear()
        self._unread.clear()


def listen(host: str, port: int, *, allow_remote: bool = False) -> socket.socket:
    """A non-blocking server socket at ``host``:``port``; raises PortError."""
    if not 0 <= port <= 0xFFFF:
        raise PortError(f"TCP port {port} is not in 0..65535")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise PortError(f"{host!r} is not an address of this machine; try 127.0.0.1") from error
    if not allow_remote and not ipaddress.ip_address(address[0]).is_loopback:
        raise PortError(f"{host} is open to other machines; use 127.0.0.1 or --allow-remote")
    try:
        server = socket.create_server((str(address[0]), port), family=family)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else error
        raise PortError(
            f"can not listen on {host}:{port}: {reason}; choose another port"
        ) from error
    server.setblocking(False)
    return server
