"""The I2C bus of a running emulation on a Unix socket: a port for any number of clients.

A client's calls run one after the other, in virtual time; transfers of several clients queue for
the wire. Calls that a client sends too early wait in the operating system. A new client for which
this process has no descriptor left gets ENFILE. A client that begins without HELLO, speaks another
version or sends a malformed call gets EPROTO with the reason in words, and is disconnected. If a
client disconnects during its transfer, the transfer completes.
"""

import contextlib
import errno
import os
import select
import socket
import stat
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.descriptors import has_room
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.emulator.ports.endpoint import Endpoint, PortError
from cubestack.firmware_model.formats import i2c_socket

CHUNK_BYTES = 1 << 16
HUNG_UP = select.EPOLLHUP | select.EPOLLERR


class I2cServer(Endpoint):
    """All connections, as one port of a scheduler; ``name`` is the path of the socket."""

    def __init__(
        self, path: Path, adapter: I2cAdapter, targets: Sequence[tuple[str, int]] = ()
    ) -> None:
        """Listen at ``path``; creates its folder, accessible to this user only.

        ``targets``: name and address of each device, for clients. Raises PortError if
        ``path`` is in use, or the folder is accessible to others.
        """
        path = path.absolute()
        self.name = str(path)
        self._adapter = adapter
        self._greeting = i2c_socket.reply(i2c_socket.VERSION, i2c_socket.pack_targets(targets))
        self._clients: dict[int, _Client] = {}
        self._files: dict[int, DeviceFile] = {}
        _make_private(path.parent)
        _remove_dead(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(self.name)
        except OSError as error:
            self._socket.close()
            raise PortError(f"can not create {path}: {_reason(error)}") from error
        self._socket.listen(socket.SOMAXCONN)
        self._socket.setblocking(False)
        self._poller = select.epoll()
        self._poller.register(self._socket, select.EPOLLIN)

    @property
    def clients(self) -> int:
        return len(self._clients)

    def watched(self) -> list[tuple[int, int]]:
        return [(self._poller.fileno(), select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
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
        except OSError:  # it has gone again
            return
        fileno = connection.fileno()
        if not has_room(fileno):
            _refuse(connection)
            return
        self._poller.register(fileno, select.EPOLLIN)
        self._clients[fileno] = _Client(
            connection,
            self._adapter,
            self._greeting,
            self._files,
            partial(self._poller.modify, fileno),
        )

    def _drop(self, fileno: int) -> None:
        self._poller.unregister(fileno)
        self._clients.pop(fileno).close()

    def close(self) -> None:
        for client in self._clients.values():
            client.close()
        self._clients.clear()
        self._poller.close()
        self._socket.close()
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.name)


class _Client:
    """One connection, and its device file."""

    def __init__(
        self,
        connection: socket.socket,
        adapter: I2cAdapter,
        greeting: bytes,
        files: dict[int, DeviceFile],
        watch: Callable[[int], None],
    ) -> None:
        """``greeting`` answers HELLO; ``watch`` changes the polled events of ``connection``."""
        self._socket = connection
        self._socket.setblocking(False)
        self._greeting = greeting
        self._greeted = False
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
        """Send pending data, then handle the next call.

        No call is handled, and input is not polled, while an answer is due or unsent.
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
            received = True  # once per exchange, so that a fast client does not starve others
        if not self._waiting:
            self._watch_for(select.EPOLLOUT if self._unsent else select.EPOLLIN)

    def _watch_for(self, events: int) -> None:
        if events != self._watched and not self.gone:
            self._watched = events
            self._watch(events)

    def _receive(self) -> bool:
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
        """Start the oldest complete call; returns whether there was one."""
        try:
            data = i2c_socket.take_packet(self._received, i2c_socket.MAX_REQUEST_BYTES)
            if data is None:
                return False
            self._waiting = True
            self._perform(*i2c_socket.split_request(data))
        except ValueError as error:
            self._answer(i2c_socket.reply(-errno.EPROTO, str(error).encode()))
            self.gone = True
        return True

    def _perform(self, key: int, call: i2c_socket.Call, body: bytes) -> None:
        """Perform a call; ValueError for one that the protocol does not allow."""
        if call is i2c_socket.Call.HELLO:
            self._greet(i2c_socket.unpack_hello(body))
            return
        if not self._greeted:
            raise ValueError(f"a connection begins with HELLO, not with {call.name}")
        if call is i2c_socket.Call.OPEN:
            self._key = key
            self._files[key] = self._file
            key = 0
        file = self._files.get(key) if key else self._file
        if file is None:
            self._answer(i2c_socket.reply(-errno.EBADF))
        else:
            file.perform(call, body, self._answer)

    def _greet(self, version: int) -> None:
        if version != i2c_socket.VERSION:
            ours = i2c_socket.VERSION
            raise ValueError(f"this emulation speaks version {ours} of the protocol, not {version}")
        self._greeted = True
        self._answer(self._greeting)

    def _answer(self, data: bytes) -> None:
        self._waiting = False
        if not self.gone:
            self._send(i2c_socket.packet(data))
            # The socket is writable, so if another call was received, exchange is called at once.
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


def _refuse(connection: socket.socket) -> None:
    with connection, contextlib.suppress(OSError):
        connection.send(i2c_socket.packet(i2c_socket.reply(-errno.ENFILE)))


def _make_private(folder: Path) -> None:
    """Create ``folder`` with mode 0700, or check an existing one; raises PortError."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise PortError(f"can not create {folder}: {_reason(error)}") from error
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    if not private or found.st_uid != os.getuid():
        raise PortError(f"{folder} must be a folder of this user only: chmod 700 {folder}")


def _remove_dead(path: Path) -> None:
    """Remove the socket of an emulation that has ended; PortError for any other file."""
    if not os.path.lexists(path):
        return
    if not path.is_socket():
        raise PortError(f"{path} exists and is not a socket; choose another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            with contextlib.suppress(FileNotFoundError):
                path.unlink()
        except OSError as error:
            raise PortError(f"can not connect to {path}: {_reason(error)}") from error
        else:
            raise PortError(
                f"{path} is already in use; choose another bus number, or stop that emulation"
            )


def _reason(error: OSError) -> str:
    """Python raises some of these errors without a number."""
    return error.strerror or str(error)
