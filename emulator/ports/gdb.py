"""A port on which GDB debugs a processor: `target remote :PORT`.

It listens on this machine only, and accepts one client at a time. When a client leaves, in whatever
way, its breakpoints are removed and the processor continues.
"""

import contextlib
import select
import socket
import time
from collections.abc import Callable

from cubestack.emulator.iss.gdb.session import Session
from cubestack.emulator.iss.gdb.target import DebugTarget
from cubestack.emulator.ports.endpoint import HUNG_UP, Endpoint, poll_now
from cubestack.emulator.ports.tcp import listen

LOOPBACK = "127.0.0.1"
LARGEST_READ = 1 << 16
POLL_NS = 20_000_000
"""Wall time between two polls of the client while only the kernel serves this port."""


class GdbEndpoint(Endpoint):
    """A listening socket for one target.

    Attributes:
        address: host and port of the socket.
        on_close: called at the end of ``close``.
    """

    def __init__(self, port: int, target: DebugTarget) -> None:
        """Listen on ``port`` (0: any free one) of this machine; raises PortError."""
        self._server = listen(LOOPBACK, port)
        self.address: tuple[str, int] = self._server.getsockname()
        self.name = f"{self.address[0]}:{self.address[1]}"
        self._target = target
        self._client: socket.socket | None = None
        self._session: Session | None = None
        self._polled_ns = 0
        self.on_close: Callable[[], None] = lambda: None

    @property
    def connected(self) -> bool:
        return self._client is not None

    def watched(self) -> list[tuple[int, int]]:
        watched = [(self._server.fileno(), select.POLLIN)]
        if self._client is not None and self._session is not None:
            writing = select.POLLOUT if self._session.output else 0
            watched.append((self._client.fileno(), select.POLLIN | writing))
        return watched

    def exchange(self, now_ps: int) -> None:
        """Accept a client, handle its packets, and report a stop to it."""
        self._accept()
        if self._client is None or self._session is None:
            return
        self._session.look()
        try:
            data = self._client.recv(LARGEST_READ)
        except BlockingIOError:
            data = None
        except OSError:
            data = b""
        if data:
            self._session.receive(data)
            self._session.look()
        self._send()
        if data == b"" or (self._session is not None and self._session.ended):
            self._drop()

    def poll(self) -> None:
        """Call ``exchange`` if that is due; cheap enough for a loop."""
        now_ns = time.monotonic_ns()
        if now_ns >= self._polled_ns + POLL_NS:
            self._polled_ns = now_ns
            self.exchange(0)

    def serve(self, timeout_s: float) -> None:
        """Wait for the client up to ``timeout_s`` of wall time, then call ``exchange``."""
        poller = select.poll()
        for fileno, events in self.watched():
            poller.register(fileno, events)
        poller.poll(timeout_s * 1000)
        self.exchange(0)

    def close(self) -> None:
        self._drop()
        self._server.close()
        self.on_close()

    def _accept(self) -> None:
        try:
            newcomer = self._server.accept()[0]
        except OSError:  # no client, or it has gone again
            return
        if self._client is not None and not poll_now(self._client.fileno(), HUNG_UP):
            newcomer.close()
            return
        self._drop()
        newcomer.setblocking(False)
        newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = newcomer
        self._session = Session(self._target)

    def _send(self) -> None:
        assert self._client is not None
        assert self._session is not None
        output = self._session.output
        try:
            while output:
                del output[: self._client.send(output)]
        except BlockingIOError:
            return
        except OSError:
            self._drop()

    def _drop(self) -> None:
        if self._session is not None:
            self._session.close()
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.close()
        self._client = self._session = None
