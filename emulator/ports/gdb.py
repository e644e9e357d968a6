"""A port on which GDB debugs a processor: `target remote :PORT`.

It listens on this machine only. One client at a time: a second one is refused. When a client
leaves, by whichever way, its breakpoints are removed and the processor runs on.
"""

import contextlib
import os
import select
import socket
import time
from collections.abc import Callable

from cubestack.emulator.iss.gdb.session import Session
from cubestack.emulator.iss.gdb.target import Target
from cubestack.emulator.ports.endpoint import HUNG_UP, Endpoint, PortError, poll_now

LOOPBACK = "127.0.0.1"
LARGEST_READ = 1 << 16
LOOK_NS = 20_000_000
"""Wall time between two looks at the client while nobody serves this port but the kernel."""


class GdbEndpoint(Endpoint):
    """A listening socket that leads to one target.

    Attributes:
        address: host and port.
        on_close: called at the end of ``close``.
    """

    def __init__(self, port: int, target: Target) -> None:
        """Listen on ``port`` (0: any free one) of this machine.

        Raises:
            PortError: it is taken, or none.
        """
        if not 0 <= port <= 0xFFFF:
            raise PortError(f"TCP port {port} is not in 0..65535")
        try:
            self._server = socket.create_server((LOOPBACK, port))
        except OSError as error:
            told = os.strerror(error.errno or 0)
            text = f"can not listen on {LOOPBACK}:{port}: {told}; choose another port"
            raise PortError(text) from error
        self._server.setblocking(False)
        self.address: tuple[str, int] = self._server.getsockname()
        self.name = f"{self.address[0]}:{self.address[1]}"
        self._target = target
        self._client: socket.socket | None = None
        self._session: Session | None = None
        self._looked_ns = 0
        self.on_close: Callable[[], None] = lambda: None

    @property
    def connected(self) -> bool:
        """Whether a client is there."""
        return self._client is not None

    def watched(self) -> list[tuple[int, int]]:
        """The server socket, and the client's."""
        watched = [(self._server.fileno(), select.POLLIN)]
        if self._client is not None and self._session is not None:
            writing = select.POLLOUT if self._session.output else 0
            watched.append((self._client.fileno(), select.POLLIN | writing))
        return watched

    def exchange(self, now_ps: int) -> None:
        """Take a client, act on what it sent, tell it of a stop."""
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

    def visit(self) -> None:
        """Exchange when it is time again; cheap, for a loop."""
        now_ns = time.monotonic_ns()
        if now_ns >= self._looked_ns + LOOK_NS:
            self._looked_ns = now_ns
            self.exchange(0)

    def serve(self, timeout_s: float) -> None:
        """Wait for the client, at most so long, and exchange."""
        poller = select.poll()
        for fileno, events in self.watched():
            poller.register(fileno, events)
        poller.poll(timeout_s * 1000)
        self.exchange(0)

    def close(self) -> None:
        """Drop the client and stop listening."""
        self._drop()
        self._server.close()
        self.on_close()

    def _accept(self) -> None:
        try:
            newcomer = self._server.accept()[0]
        except OSError:  # nobody, or gone again
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
