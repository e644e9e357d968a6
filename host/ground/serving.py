"""Serves an ASGI application on this machine, in a thread."""

import asyncio
import ipaddress
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from starlette.types import ASGIApp
from uvicorn import Config, Server
from uvicorn.protocols.http.h11_impl import H11Protocol

from cubestack.host.errors import PortOpenError

LOOPBACK = "127.0.0.1"

MOST_CONNECTIONS = 64
"""Most connections at once, so that clients can not slow down the emulation."""

REQUEST_S = 5.0
"""Time-out of a connection's first request, wall time in s."""

LARGEST_MESSAGE = 1 << 20
"""Longest message on a WebSocket in bytes."""


class _Connection(H11Protocol):
    """Closes excess connections, and those without a request."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self.loop.call_later(REQUEST_S, self._expire)

    def _expire(self) -> None:
        idle = vars(self)["scope"] is None  # its declared type excludes None
        if idle and not self.transport.is_closing():
            self.transport.abort()


class Serving:
    """Serves an application at ``address``: host and port."""

    def __init__(self, app: ASGIApp, host: str, port: int, *, allow_remote: bool = False) -> None:
        """Listen on ``port`` (0: any free one).

        Raises PortOpenError if it is in use or invalid, or if other machines could reach it
        without ``allow_remote``.
        """
        self._socket = _listen(host, port, allow_remote=allow_remote)
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        self._server = _Server(
            Config(
                app,
                http=_Connection,
                ws="websockets-sansio",
                ws_max_size=LARGEST_MESSAGE,
                lifespan="off",
                log_level="critical",
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=1,
            )
        )

    @property
    def url(self) -> str:
        host, port = self.address
        return f"http://{f'[{host}]' if ':' in host else host}:{port}"

    @contextmanager
    def running(self) -> Iterator[None]:
        """Serve in a thread for the duration of the block."""
        thread = Thread(target=self._server.run, args=([self._socket],), daemon=True)
        thread.start()
        self._server.ready.wait()
        try:
            yield
        finally:
            self._server.should_exit = True
            thread.join()
            self._socket.close()


class _Server(Server):
    """Sets ``ready`` when it accepts connections."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.ready = Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.ready.set()


def _listen(host: str, port: int, *, allow_remote: bool) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, OverflowError) as error:
        raise PortOpenError(f"can not listen on {host}:{port}: {error}") from None
    if not ipaddress.ip_address(address[0]).is_loopback and not allow_remote:
        raise PortOpenError(
            f"{host} can be reached from other machines: take {LOOPBACK}, or give --allow-remote"
        )
    try:
        return socket.create_server(address[:2], family=family)
    except (OSError, OverflowError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
        raise PortOpenError(f"can not listen on {host}:{port}: {reason}") from None


def loopback_name(host: str) -> bool:
    """Whether ``host`` is a loopback name or address of this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
