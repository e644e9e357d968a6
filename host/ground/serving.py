"""Serves an ASGI application on this machine, in a thread."""

import asyncio
import ipaddress
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from starlette.types import ASGIApp
from uvicorn import Config, Server
from uvicorn.protocols.http.h11_impl import H11Protocol

from cubestack.host.errors import PortOpenError

LOOPBACK = "127.0.0.1"

MOST_CONNECTIONS = 64
"""Most connections at once, so that clients can not slow down the emulation."""

GRACE_S, MOST_AT_ONCE = 1.0, 1000
"""Wall time in which a request can arrive although there are more, and most in such a burst."""

REQUEST_S = 5.0
"""Time-out of the head of a request, wall time in s."""

AUTHORISED = "cubestack.authorised"
"""Key that `Guard` adds to the scope of a request that it passes on."""

SWITCH_S = 0.0002
"""Wall time after which Python gives the other thread its turn; usually 25 times as long."""

LARGEST_MESSAGE = 1 << 20
"""Longest message on a WebSocket in bytes."""


class _Connection(H11Protocol):
    """Closes connections whose requests do not arrive, and excess ones that nobody authorised."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._since = self.loop.time()
        self._deadline: asyncio.TimerHandle | None = None
        self._await_request()
        # One that was aborted is listed until the loop's next turn.
        kept = [one for one in self.connections if not one.transport.is_closing()]
        if len(kept) > MOST_CONNECTIONS:
            own = (one for one in kept if isinstance(one, _Connection))
            waiting = [one for one in own if not one._authorised]
            oldest = min(waiting, key=lambda one: one._since, default=self)
            if self._since > oldest._since + GRACE_S or len(kept) > MOST_AT_ONCE:
                oldest.transport.abort()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if not self._idle or not self.conn.trailing_data[0]:
            self._cancel_deadline()
        elif self._deadline is None:  # a part of a request's head
            self._await_request()

    def connection_lost(self, exc: Exception | None) -> None:
        self._cancel_deadline()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        """End a connection whose request is none of a WebSocket: nobody would answer it."""
        super().handle_websocket_upgrade(event)
        protocol: Any = self.transport.get_protocol()
        if not protocol.handshake_initiated:
            self.transport.abort()

    @property
    def _idle(self) -> bool:
        """Whether no request is being answered."""
        cycle, scope = vars(self)["cycle"], vars(self)["scope"]  # their types exclude None
        return scope is None if cycle is None else bool(cycle.response_complete)

    @property
    def _authorised(self) -> bool:
        return not self._idle and AUTHORISED in self.scope

    def _await_request(self) -> None:
        self._deadline = self.loop.call_later(REQUEST_S, self._expire)

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = None

    def _expire(self) -> None:
        self._deadline = None
        if self._idle and not self.transport.is_closing():
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
                backlog=MOST_CONNECTIONS,  # accepted in one turn, before requests are read
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
        """Serve in a thread for the duration of the block.

        The emulation, which is in another one and often waits, then gets its turn sooner.
        """
        before = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        thread = Thread(target=self._server.run, args=([self._socket],), daemon=True)
        thread.start()
        self._server.ready.wait()
        try:
            yield
        finally:
            self._server.should_exit = True
            thread.join()
            self._socket.close()
            sys.setswitchinterval(before)


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
