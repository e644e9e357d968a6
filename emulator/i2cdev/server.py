"""The I2C bus of a running emulation on a Unix socket: a port for any number of clients.

A client's calls are done one after the other, in virtual time; those of several clients queue for
the wire, whole transfers at a time. What a client sends too early waits in the operating system,
and so does a new client beyond ``MAX_CLIENTS``. One that sends nonsense is hung up on. One that
goes away while its transfer is on the wire misses the answer, that is all.
"""

import contextlib
import errno
import os
import select
import socket
import stat
from collections.abc import Callable
from functools import partial
from pathlib import Path

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.emulator.ports.endpoint import Endpoint, PortError
from cubestack.firmware_model.formats import linux_i2c as linux

MAX_CLIENTS = 64
"""Connections at one time; a program takes one, and one for each device file it has open."""

CHUNK_BYTES = 1 << 16
HUNG_UP = select.EPOLLHUP | select.EPOLLERR


class I2cServer(Endpoint):
    """All connections, as one port of a scheduler.

    Attributes:
        name: path of the socket.
    """

    def __init__(self, path: Path, adapter: I2cAdapter) -> None:
        """Listen at ``path``, whose folder is made for this user alone.

        Raises PortError when something lives there already, or the folder is open to others.
        """
        path = path.absolute()
        self.name = str(path)
        self._adapter = adapter
        self._clients: dict[int, _Client] = {}
        self._files: dict[int, DeviceFile] = {}
        _make_private(path.parent)
        _remove_dead(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(self.name)
        except OSError as error:
            self._socket.close()
            raise PortError(f"can not make {path}: {_reason(error)}") from error
        self._socket.listen(MAX_CLIENTS)
        self._socket.setblocking(False)
        self._poller = select.epoll()
        self._poller.register(self._socket, select.EPOLLIN)

    @property
    def clients(self) -> int:
        """Connections that are open now."""
        return len(self._clients)

    def watched(self) -> list[tuple[int, int]]:
        """All connections at once, and whoever comes."""
        return [(self._poller.fileno(), select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """Takes calls; answers go out at the end of their transfer, whenever that is."""
        for fileno, events in self._poller.poll(0):
            client = self._clients.get(fileno)
            if client is None:
                self._accept()
                continue
            client.exchange(hung_up=bool(events & HUNG_UP))
            if client.gone:
                self._drop(fileno)

    def _accept(self) -> None:
        try:
            connection, _ = self._socket.accept()
        except OSError:  # gone again
            return
        fileno = connection.fileno()
        self._poller.register(fileno, select.EPOLLIN)
        self._clients[fileno] = _Client(
            connection, self._adapter, self._files, partial(self._poller.modify, fileno)
        )
        if len(self._clients) == MAX_CLIENTS:
            self._poller.unregister(self._socket)

    def _drop(self, fileno: int) -> None:
        if len(self._clients) == MAX_CLIENTS:
            self._poller.register(self._socket, select.EPOLLIN)
        self._poller.unregister(fileno)
        self._clients.pop(fileno).close()

    def close(self) -> None:
        """Hang up on all clients, and remove the socket."""
        for client in self._clients.values():
            client.close()
        self._clients.clear()
        self._poller.close()
        self._socket.close()
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.name)


class _Client:
    """One connection, with the file that it stands for."""

    def __init__(
        self,
        connection: socket.socket,
        adapter: I2cAdapter,
        files: dict[int, DeviceFile],
        watch: Callable[[int], None],
    ) -> None:
        """Serve ``connection``, which is watched for input; ``watch`` gets other events."""
        self._socket = connection
        self._socket.setblocking(False)
        self._files = files
        self._file = DeviceFile(adapter)
        self._watch = watch
        self._watched: int = select.EPOLLIN
        self._key = 0
        self._received = bytearray()
        self._unsent = bytearray()
        self._waiting = False
        self.gone = False

    def exchange(self, *, hung_up: bool) -> None:
        """Send what was left, then take the next call.

        While an answer is due or unsent nothing is taken; input that comes nevertheless is not
        watched for from then on.
        """
        if self._unsent:
            self._send(b"")
        if self._waiting or self._unsent:
            self.gone = self.gone or hung_up
            self._watch_for(select.EPOLLOUT if self._unsent else 0)
            return
        received = False
        while not (self._waiting or self._unsent or self.gone):
            if self._take_call():
                continue
            if received or not self._receive():
                break
            received = True  # once: a client that asks as fast as it is answered is not alone
        if not self._waiting:
            self._watch_for(select.EPOLLOUT if self._unsent else select.EPOLLIN)

    def _watch_for(self, events: int) -> None:
        if events != self._watched and not self.gone:
            self._watched = events
            self._watch(events)

    def _receive(self) -> bool:
        """Read what is there; returns whether anything came."""
        try:
            data = self._socket.recv(CHUNK_BYTES)
        except BlockingIOError:
            return False
        except OSError:
            data = b""
        self.gone = not data
        self._received += data
        return bool(data)

    def _take_call(self) -> bool:
        """Start the oldest whole call; returns whether there was one."""
        try:
            data = linux.take_packet(self._received, linux.MAX_REQUEST_BYTES)
            if data is None:
                return False
            self._waiting = True
            key, call, body = linux.split_request(data)
            if call is linux.Call.OPEN:
                self._key = key
                self._files[key] = self._file
                key = 0
            file = self._files.get(key) if key else self._file
            if file is None:
                self._answer(linux.reply(-errno.EBADF))
            else:
                file.perform(call, body, self._answer)
        except ValueError:
            self.gone = True
        return True

    def _answer(self, data: bytes) -> None:
        self._waiting = False
        if not self.gone:
            self._send(linux.LENGTH.pack(len(data)) + data)
            # There is room to write, so with a further call here it is looked at again at once.
            more = self._unsent or self._received
            self._watch_for(select.EPOLLOUT if more else select.EPOLLIN)

    def _send(self, data: bytes) -> None:
        self._unsent += data
        try:
            del self._unsent[: self._socket.send(self._unsent)]
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def close(self) -> None:
        self.gone = True
        self._socket.close()
        if self._key and self._files.get(self._key) is self._file:
            del self._files[self._key]


def _make_private(folder: Path) -> None:
    """Make ``folder`` with mode 0700, or see that it is one; raises PortError."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise PortError(f"can not make {folder}: {_reason(error)}") from error
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    if not private or found.st_uid != os.getuid():
        raise PortError(f"{folder} must be a folder of this user alone: chmod 700 {folder}")


def _remove_dead(path: Path) -> None:
    """Remove the socket of an emulation that has gone; raises PortError when it has not."""
    if not os.path.lexists(path):
        return
    if not path.is_socket():
        raise PortError(f"{path} exists and is no socket; choose another one")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            with contextlib.suppress(FileNotFoundError):
                path.unlink()
        except OSError as error:
            raise PortError(f"can not look at {path}: {_reason(error)}") from error
        else:
            raise PortError(f"{path} is served already; choose another bus number, or end that one")


def _reason(error: OSError) -> str:
    """Its reason; Python itself raises some without an error number."""
    return error.strerror or str(error)
