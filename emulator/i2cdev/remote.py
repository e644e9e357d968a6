"""The bus of an emulation in another process, reached through its socket."""

import contextlib
import errno
import os
import select
import socket
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

from cubestack.emulator.ports.endpoint import Endpoint, PortError
from cubestack.firmware_model.formats.i2c_socket import (
    Call,
    pack_hello,
    pack_open,
    packet,
    reply,
    request,
    split_reply,
    take_packet,
    unpack_targets,
)

CHUNK_BYTES = 1 << 16
PATIENCE_S = 10.0
"""Wall time in which an emulation must answer a greeting; one that is paused does not."""

Done = Callable[[bytes], None]
HELLO = request(0, Call.HELLO, pack_hello())


class RemoteBus(Endpoint):
    """Opens device files of the bus; as a port of a scheduler, it receives their replies."""

    def __init__(self, path: Path) -> None:
        """Use the socket at ``path``; raises PortError if no emulation serves it."""
        self.name = str(path)
        self._files: dict[int, _RemoteFile] = {}
        self._poller = select.epoll()
        self._connect().close()

    def greet(self) -> list[tuple[str, int]]:
        """Name and address of each device, from the emulation; waits for it.

        Raises PortError if it refuses this version of the protocol, or does not answer in time.
        """
        with contextlib.closing(self._connect()) as link:
            link.settimeout(PATIENCE_S)
            received = bytearray()
            try:
                link.sendall(packet(HELLO))
                while (answer := take_packet(received)) is None:
                    data = link.recv(CHUNK_BYTES)
                    if not data:
                        raise PortError(f"the emulation at {self.name} has ended")
                    received += data
            except TimeoutError:
                raise PortError(f"{self.name} does not answer; is that emulation paused?") from None
        result, data = split_reply(answer)
        if result < 0:
            reason = data.decode(errors="replace") or os.strerror(-result)
            raise PortError(f"{self.name} refuses: {reason}")
        return unpack_targets(data)

    def open(self, flags: int = os.O_RDWR) -> "_RemoteFile":
        """Open a device file with flags of open(2); raises PortError."""
        link = self._connect()
        fileno = link.fileno()
        self._poller.register(fileno, select.EPOLLIN)
        file = _RemoteFile(link, partial(self._poller.modify, fileno), partial(self._drop, fileno))
        self._files[fileno] = file
        file.perform(Call.HELLO, pack_hello(), lambda _reply: None)
        file.perform(Call.OPEN, pack_open(flags), lambda _reply: None)
        return file

    def _drop(self, fileno: int) -> None:
        self._poller.unregister(fileno)
        del self._files[fileno]

    def _connect(self) -> socket.socket:
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            link.connect(self.name)
        except OSError as error:
            link.close()
            raise PortError(
                f"no emulation serves {self.name} ({error.strerror or error}); "
                "start one with cubestack emulate, or omit --attach"
            ) from error
        link.setblocking(False)
        return link

    def watched(self) -> list[tuple[int, int]]:
        return [(self._poller.fileno(), select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        for fileno, _ in self._poller.poll(0):
            if fileno in self._files:
                self._files[fileno].exchange()

    def close(self) -> None:
        for file in list(self._files.values()):
            file.close()
        self._poller.close()


class _RemoteFile:
    """A device file; the other process has its state."""

    def __init__(
        self, link: socket.socket, watch: Callable[[int], None], drop: Callable[[], None]
    ) -> None:
        """``watch`` changes the events that are polled for ``link``, ``drop`` stops that."""
        self._link = link
        self._watch = watch
        self._drop = drop
        self._due: deque[Done] = deque()
        self._received = bytearray()
        self._unsent = bytearray()
        self._blocked = False
        self.gone = False

    def perform(self, call: Call, body: bytes, done: Done) -> None:
        """Send a call; ``done`` receives the packed reply, EIO if the emulation has ended."""
        if self.gone:
            done(reply(-errno.EIO))
            return
        self._due.append(done)
        self._unsent += packet(request(0, call, body))
        self._send()

    def close(self) -> None:
        """Disconnect; pending calls fail with EIO."""
        if self.gone:
            return
        self.gone = True
        self._drop()
        self._link.close()
        while self._due:
            self._due.popleft()(reply(-errno.EIO))

    def exchange(self) -> None:
        self._send()
        if self.gone:
            return
        try:
            data = self._link.recv(CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._received += data
        while self._due and (answer := take_packet(self._received)) is not None:
            self._due.popleft()(answer)
        if not data:
            self.close()

    def _send(self) -> None:
        try:
            while self._unsent and not self.gone:
                del self._unsent[: self._link.send(self._unsent)]
        except BlockingIOError:
            pass
        except OSError:
            self.close()
        blocked = bool(self._unsent)
        if blocked != self._blocked and not self.gone:
            self._blocked = blocked
            self._watch(select.EPOLLIN | (select.EPOLLOUT if blocked else 0))
