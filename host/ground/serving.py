"""Serves an ASGI application on this machine, in a thread beside whatever else goes on."""

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
"""At once; more are turned away, so that none takes what the emulation needs."""

REQUEST_S = 5.0
"""Wall time that a connection has for its first request."""

LARGEST_MESSAGE = 1 << 20
"""Bytes of a message on a WebSocket."""


class _Connection(H11Protocol):
    """One that is neither too many nor silent."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self.loop.call_later(REQUEST_S, self._expire)

    def _expire(self) -> None:
        asked = vars(self)["scope"] is not None  # declared as what is never None
        if not asked and not self.transport.is_closing():
            self.transport.abort()


class Serving:
    """An application that is being served.

    Attributes:
        address: host and port.
    """

    def __init__(self, app: ASGIApp, host: str, port: int, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port`` (0: any free one).

        Raises PortOpenError: it is taken or none, or other machines could reach it.
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
        """Serve in a thread as long as the block lasts."""
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
    """One that tells when it takes connections."""

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
        told = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
        raise PortOpenError(f"can not listen on {host}:{port}: {told}") from None


def loopback_name(host: str) -> bool:
    """Whether ``host``, as a request names it, is this machine to itself."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
