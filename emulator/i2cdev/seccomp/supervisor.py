"""Answers a filtered program's calls on /dev/i2c-N; the kernel performs all others.

An opened device file is one end of a socket pair in the program. The kernel counts its copies in
all processes: the inode identifies the file, and when the last copy is closed, the other end, which
is kept here, is hung up. What a socket does as a device file does (poll, lseek, mmap, close and so
on) is left to the kernel.
"""

import ctypes
import errno
import os
import select
import socket
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Protocol

from cubestack.emulator.i2cdev.descriptors import has_room
from cubestack.emulator.i2cdev.device_file import MODE_FLAGS
from cubestack.emulator.i2cdev.device_node import ENTRY_HEAD, DeviceNode
from cubestack.emulator.i2cdev.seccomp import filter as sent
from cubestack.emulator.i2cdev.seccomp import marshal
from cubestack.emulator.i2cdev.seccomp.abi import Abi
from cubestack.emulator.i2cdev.seccomp.notify import Listener, Notification, write_memory
from cubestack.emulator.i2cdev.seccomp.path_calls import Handler, PathCalls, signed
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.firmware_model.formats.i2c_socket import Call, split_reply
from cubestack.firmware_model.formats.linux_i2c import Ioctl

PIDFD_GETFD = 438  # the same on all machines
LISTED_BYTES = 1 << 14
"""Largest part of a folder that is listed at once."""


class OpenFile(Protocol):
    """An opened device file on the emulated bus."""

    def perform(self, call: Call, body: bytes, done: Callable[[bytes], None]) -> None:
        """Perform a call; ``done`` receives the packed reply, now or later."""

    def close(self) -> None: ...


Files = Callable[[int], OpenFile]
"""Opens a device file, with flags of open(2); raises OSError."""


class _Opened:
    """A device file, with the end of the socket pair that is kept here."""

    def __init__(self, file: OpenFile, end: socket.socket, flags: int) -> None:
        self.file = file
        self.end = end
        self.mode = flags & MODE_FLAGS

    def close(self) -> None:
        self.end.close()
        self.file.close()


class Supervisor(Endpoint):
    """The filtered program's calls, as a port of a scheduler.

    Attributes:
        ended: whether every process under the filter has ended.
        shares_processor: see ``Listener``.
    """

    def __init__(self, listener: Listener, abi: Abi, node: DeviceNode, files: Files) -> None:
        self.name = node.path
        self.ended = False
        self.shares_processor = listener.shares_processor
        self._listener = listener
        self._abi = abi
        self._node = node
        self._files = files
        self._opened: dict[int, _Opened] = {}
        self._inodes: dict[int, int] = {}  # by descriptor of the end that is kept
        self._transfers = 0
        self._poller = select.epoll()
        self._poller.register(listener.fd, select.EPOLLIN)
        self._paths = PathCalls(listener, abi, node, self)
        named = self._paths.handlers() | self._by_descriptor()
        self._handlers = {
            number: named[name] for name, number in abi.calls.items() if name in named
        }

    def watched(self) -> list[tuple[int, int]]:
        return [] if self.ended else [(self._poller.fileno(), select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        while not self.ended and (ready := self._poller.poll(0)):
            for fd, events in ready:
                if fd != self._listener.fd:
                    self._forget(fd)
                elif not events & select.EPOLLIN:
                    self.ended = True
                elif (call := self._listener.receive()) is not None:
                    self._handle(call)
            if self._transfers:
                break  # the scheduler has to run the transfer

    def close(self) -> None:
        """Close all device files; the kernel fails later calls."""
        for opened in self._opened.values():
            opened.close()
        self._poller.close()
        os.close(self._listener.fd)

    def _forget(self, fd: int) -> None:
        self._poller.unregister(fd)
        self._opened.pop(self._inodes.pop(fd)).close()

    def _handle(self, call: Notification) -> None:
        """Answer ``call``, or let it pass; an error is returned to the program."""
        try:
            self._handlers[call.number](call)
        except OSError as error:
            self._listener.answer(call, -(error.errno or errno.EIO))

    # --- opening ------------------------------------------------------------------------------

    def open_device(self, call: Notification, flags: int) -> None:
        try:
            file = self._files(flags)
        except OSError as error:
            raise OSError(errno.ENODEV, str(error)) from error
        mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            if not has_room(theirs.fileno()):
                mine.close()
                file.close()
                raise OSError(errno.ENFILE, "no more device files: this process's limit")
            theirs.shutdown(socket.SHUT_RD)  # so that poll says that it is readable, as in Linux
            theirs.setblocking(not flags & os.O_NONBLOCK)
            inode = os.fstat(theirs.fileno()).st_ino
            self._opened[inode] = _Opened(file, mine, flags)
            self._inodes[mine.fileno()] = inode
            self._poller.register(mine, 0)  # reports only the hang-up
            self._install(call, theirs.fileno(), close_on_exec=bool(flags & os.O_CLOEXEC))

    def open_listing(self, call: Notification, flags: int) -> None:
        with open(os.memfd_create("i2c"), "w+b", buffering=0) as text:
            text.write(self._node.listing.encode())
            text.seek(0)
            self._install(call, text.fileno(), close_on_exec=bool(flags & os.O_CLOEXEC))

    def _install(self, call: Notification, fd: int, *, close_on_exec: bool) -> None:
        """Return a copy of ``fd``: with the lowest free number, as in Linux, but none below FIRST.

        Raises OSError.
        """
        numbers = None
        if not all(os.path.lexists(f"/proc/{call.pid}/fd/{low}") for low in range(sent.FIRST)):
            taken = {int(name) for name in os.listdir(f"/proc/{call.pid}/fd")}
            numbers = next(n for n in range(sent.FIRST, len(taken) + 4) if n not in taken)
        self._listener.answer_with_descriptor(call, fd, numbers, close_on_exec=close_on_exec)

    # --- by descriptor ------------------------------------------------------------------------

    def _by_descriptor(self) -> dict[str, Handler]:
        reads, vectors = marshal.plain, marshal.vector
        transfers: dict[str, Callable[[Notification], marshal.Transfer]] = {}
        for reading, plain, positioned in ((True, "read", "pread"), (False, "write", "pwrite")):
            transfers |= {
                plain: partial(reads, reading=reading),
                f"{plain}v": partial(vectors, reading=reading),
                f"{positioned}64": partial(reads, reading=reading, positioned=True),
                f"{positioned}v": partial(vectors, reading=reading, positioned=True),
                f"{positioned}v2": partial(vectors, reading=reading, positioned=True, flags=True),
            }
        handles: dict[str, Callable[[Notification, _Opened], None]] = {
            "ioctl": self._ioctl,
            "fstat": lambda call, _opened: self._paths.fstat(call),
            "dup": self._duplicate,
            "fcntl": self._fcntl,
            **{name: partial(self._transfer, fetch=fetch) for name, fetch in transfers.items()},
        }
        named = {name: partial(self._on_file, handle=handle) for name, handle in handles.items()}
        for name in ("dup2", "dup3"):
            named[name] = partial(self._refuse, places=(0,), number=errno.EBADF)
        named["epoll_ctl"] = partial(self._refuse, places=(2,), number=errno.EPERM)
        named["sendfile"] = partial(self._refuse, places=(0, 1), number=errno.EINVAL)
        for name in ("splice", "copy_file_range"):
            named[name] = partial(self._refuse, places=(0, 2), number=errno.EINVAL)
        return named | {"getdents64": self._list}

    def _find(self, pid: int, fd: int) -> _Opened | None:
        if not self._opened:
            return None
        try:
            return self._opened.get(os.stat(f"/proc/{pid}/fd/{fd}").st_ino)
        except OSError:
            return None

    def is_device(self, pid: int, fd: int) -> bool:
        return self._find(pid, fd) is not None

    def _on_file(self, call: Notification, handle: Callable[[Notification, _Opened], None]) -> None:
        """Handle a call if its descriptor, argument 0, is ours."""
        opened = self._find(call.pid, signed(call.arguments[0]))
        if opened is None:
            self._listener.continue_call(call)
        else:
            handle(call, opened)

    def _refuse(self, call: Notification, places: tuple[int, ...], number: int) -> None:
        """Fail the call with ``number`` if one of its descriptors is ours."""
        if any(self.is_device(call.pid, signed(call.arguments[place])) for place in places):
            raise OSError(number, "no such call on a device file")
        self._listener.continue_call(call)

    def _perform(
        self,
        call: Notification,
        opened: _Opened,
        marshalled: marshal.Marshalled,
        end: Callable[[int], None],
    ) -> None:
        """Perform one call on the bus; ``end`` receives its result, unless the caller is dead."""

        def done(reply: bytes) -> None:
            self._transfers -= 1
            result, data = split_reply(reply)
            if not self._listener.waits(call):
                return
            if result >= 0:
                try:
                    result = marshalled.finish(result, data)
                except OSError as error:
                    result = -(error.errno or errno.EIO)
            end(result)

        self._transfers += 1
        opened.file.perform(marshalled.call, marshalled.body, done)

    def _ioctl(self, call: Notification, opened: _Opened) -> None:
        if call.arguments[1] & 0xFFFF_FFFF not in set(Ioctl):
            raise OSError(errno.ENOTTY, "a request of sockets")
        answer = partial(self._listener.answer, call)
        self._perform(call, opened, marshal.ioctl(call), answer)

    def _transfer(
        self, call: Notification, opened: _Opened, fetch: Callable[[Notification], marshal.Transfer]
    ) -> None:
        """Perform the parts of a read or write in turn, until one is short or fails."""
        transfer = fetch(call)
        parts, total = deque(transfer.parts), 0

        def begin() -> None:
            if not parts:
                self._listener.answer(call, total)
                return
            place, count = parts.popleft()
            try:
                marshalled = transfer.part(call.pid, place, count)
            except OSError as error:
                end(count, -(error.errno or errno.EFAULT))
            else:
                self._perform(call, opened, marshalled, partial(end, count))

        def end(count: int, result: int) -> None:
            nonlocal total
            if result < 0:
                self._listener.answer(call, total or result)
                return
            total += result
            if result != count:
                parts.clear()
            begin()

        begin()

    def _duplicate(self, call: Notification, _opened: _Opened, close_on_exec: bool = False) -> None:
        fd = _take_descriptor(call.pid, signed(call.arguments[0]))
        try:
            self._install(call, fd, close_on_exec=close_on_exec)
        finally:
            os.close(fd)

    def _fcntl(self, call: Notification, opened: _Opened) -> None:
        command = call.arguments[1] & 0xFFFF_FFFF
        if command != sent.F_GETFL:
            self._duplicate(call, opened, command == sent.F_DUPFD_CLOEXEC)
            return
        path = f"/proc/{call.pid}/fdinfo/{signed(call.arguments[0])}"
        with open(path, encoding="ascii") as lines:
            flags = next(int(line.split()[1], 8) for line in lines if line.startswith("flags:"))
        flags &= ~(MODE_FLAGS | os.O_CLOEXEC)
        self._listener.answer(call, opened.mode if opened.mode & os.O_PATH else flags | opened.mode)

    # --- listing --------------------------------------------------------------------------------

    def _list(self, call: Notification) -> None:
        """List the device file at the end of the first part of /dev."""
        entry = self._node.entry(0)
        fd = signed(call.arguments[0])
        space = min(call.arguments[2] & 0xFFFF_FFFF, LISTED_BYTES) - len(entry)
        try:
            ours = os.readlink(f"/proc/{call.pid}/fd/{fd}") == "/dev" and space > 0
        except OSError:
            ours = False
        listed = b""
        if ours:
            copy = _take_descriptor(call.pid, fd)
            try:
                if not os.lseek(copy, 0, os.SEEK_CUR):
                    listed = _entries(copy, self._abi.calls["getdents64"], space)
            finally:
                os.close(copy)
        if not listed:
            self._listener.continue_call(call)
            return
        position, last = 0, 0
        while position < len(listed):
            _, last, length, _ = ENTRY_HEAD.unpack_from(listed, position)
            position += length
        if os.path.basename(self._node.path).encode() + b"\0" not in listed:
            listed += self._node.entry(last)
        write_memory(call.pid, call.arguments[1], listed)
        self._listener.answer(call, len(listed))


def _entries(folder: int, number: int, space: int) -> bytes:
    """The next entries of ``folder`` by getdents64; none if ``space`` does not suffice for one."""
    buffer = ctypes.create_string_buffer(space)
    count = ctypes.CDLL(None, use_errno=True).syscall(number, folder, buffer, space)
    return buffer.raw[: max(0, int(count))]


def _take_descriptor(thread: int, fd: int) -> int:
    """A copy in this process of descriptor ``fd`` of ``thread``; raises OSError."""
    with open(f"/proc/{thread}/status", encoding="ascii", errors="replace") as lines:
        leader = next(int(line.split()[1]) for line in lines if line.startswith("Tgid:"))
    libc = ctypes.CDLL(None, use_errno=True)
    process = os.pidfd_open(leader)
    try:
        copy = int(libc.syscall(PIDFD_GETFD, process, fd, 0))
    finally:
        os.close(process)
    if copy < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"can not copy descriptor {fd}: {os.strerror(number)}")
    return copy
