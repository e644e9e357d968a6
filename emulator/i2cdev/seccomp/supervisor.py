"""Answers a filtered program's calls on /dev/i2c-N; the kernel performs all others.

An opened device file is one end of a socket pair in the program, with a descriptor in the filter's
range. The kernel counts its copies in all processes: the inode identifies the file, and when the
last copy is closed, the other end, which is kept here, is hung up.
"""

import contextlib
import ctypes
import errno
import os
import resource
import select
import socket
import struct
from collections.abc import Callable
from functools import partial
from typing import Protocol

from cubestack.emulator.i2cdev.device_node import DeviceNode, Found
from cubestack.emulator.i2cdev.seccomp import marshal
from cubestack.emulator.i2cdev.seccomp.filter import AT_EMPTY_PATH, F_DUPFD_CLOEXEC, Abi
from cubestack.emulator.i2cdev.seccomp.notify import (
    Listener,
    Notification,
    read_memory,
    read_text,
    write_memory,
)
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.firmware_model.formats.linux_i2c import Call, split_reply

DESCRIPTORS = 64
"""Limit of open device files per process."""

PATH_BYTES = 4096
PIDFD_GETFD = 438  # the same on all machines
_FLAGS = struct.Struct("=Q")

Handler = Callable[[Notification], None]


class OpenFile(Protocol):
    """An opened device file on the emulated bus."""

    def perform(self, call: Call, body: bytes, done: Callable[[bytes], None]) -> None:
        """Perform a call; ``done`` receives the packed reply, now or later."""

    def close(self) -> None: ...


Files = Callable[[], OpenFile]
"""Opens a device file; raises OSError."""


def descriptor_range() -> range:
    """Descriptors for device files: the last ones of a process, and below select's 1024."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    end = 1024 if soft == resource.RLIM_INFINITY else min(soft, 1024)
    return range(max(3, end - DESCRIPTORS), end)


class Supervisor(Endpoint):
    """The filtered program's calls, as a port of a scheduler.

    Attributes:
        ended: whether every process under the filter has ended.
        shares_processor: see ``Listener``.
    """

    def __init__(
        self, listener: Listener, abi: Abi, node: DeviceNode, descriptors: range, files: Files
    ) -> None:
        self.name = node.path
        self.ended = False
        self.shares_processor = listener.shares_processor
        self._listener = listener
        self._abi = abi
        self._node = node
        self._descriptors = descriptors
        self._files = files
        self._opened: dict[int, tuple[OpenFile, socket.socket]] = {}
        self._transfers = 0
        self._poller = select.epoll()
        self._poller.register(listener.fd, select.EPOLLIN)
        named = self._by_path() | self._by_descriptor()
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
        for file, end in self._opened.values():
            end.close()
            file.close()
        self._poller.close()
        os.close(self._listener.fd)

    def _forget(self, fd: int) -> None:
        self._poller.unregister(fd)
        for inode, (file, end) in list(self._opened.items()):
            if end.fileno() == fd:
                del self._opened[inode]
                end.close()
                file.close()

    def _handle(self, call: Notification) -> None:
        """Answer ``call``, or let it pass; an error is returned to the program."""
        try:
            self._handlers[call.number](call)
        except OSError as error:
            self._listener.answer(call, -(error.errno or errno.EIO))

    # --- by path ------------------------------------------------------------------------------

    def _by_path(self) -> dict[str, Handler]:
        here = partial(self._on_path, folder=None, path=0)
        there = partial(self._on_path, folder=0, path=1)
        statx = partial(self._stat, buffer=4, extended=True)
        exists, no_link, no_attribute = (
            partial(self._end, result=result) for result in (0, -errno.EINVAL, -errno.EOPNOTSUPP)
        )
        return {
            "open": partial(here, handle=partial(self._open, place=1)),
            "openat": partial(there, handle=partial(self._open, place=2)),
            "openat2": partial(there, handle=partial(self._open, place=2, how=True)),
            "stat": partial(here, handle=partial(self._stat, buffer=1)),
            "lstat": partial(here, handle=partial(self._stat, buffer=1)),
            "newfstatat": partial(self._stat_at, flags=3, handle=partial(self._stat, buffer=2)),
            "statx": partial(self._stat_at, flags=2, handle=statx),
            "access": partial(here, handle=exists),
            "faccessat": partial(there, handle=exists),
            "faccessat2": partial(there, handle=exists),
            "readlink": partial(here, handle=no_link),
            "readlinkat": partial(there, handle=no_link),
            "getxattr": partial(here, handle=no_attribute),
            "lgetxattr": partial(here, handle=no_attribute),
        }

    def _on_path(
        self,
        call: Notification,
        folder: int | None,
        path: int,
        handle: Callable[[Notification, Found], None],
    ) -> None:
        """Handle a call if its path is ours; ``path`` and ``folder`` are argument numbers."""
        try:
            text = os.fsdecode(read_text(call.pid, call.arguments[path], PATH_BYTES))
        except OSError:
            text = ""  # the kernel will report the error
        found = None
        if self._node.may_match(text):
            start = None if folder is None else _signed(call.arguments[folder])
            found = self._node.find(text, call.pid, start)
        if found is None:
            self._listener.continue_call(call)
        else:
            handle(call, found)

    def _open(self, call: Notification, found: Found, place: int, *, how: bool = False) -> None:
        """Argument number ``place`` has the flags, or with ``how`` their address."""
        flags = call.arguments[place]
        if how:
            (flags,) = _FLAGS.unpack(read_memory(call.pid, flags, _FLAGS.size))
        if flags & os.O_DIRECTORY:
            raise OSError(errno.ENOTDIR, f"{self.name} is not a folder")
        close_on_exec = bool(flags & os.O_CLOEXEC)
        number = self._free_number(call.pid)
        if found is Found.LISTING:
            with open(os.memfd_create("i2c"), "w+b", buffering=0) as text:
                text.write(self._node.listing.encode())
                text.seek(0)
                self._listener.answer_with_descriptor(
                    call, text.fileno(), number, close_on_exec=close_on_exec
                )
            return
        try:
            file = self._files()
        except OSError as error:
            raise OSError(errno.ENODEV, str(error)) from error
        mine, theirs = socket.socketpair()
        with theirs:
            # Calls that the filter does not catch (on a copy with a low number) fail, not hang.
            mine.shutdown(socket.SHUT_RD)
            theirs.setblocking(False)
            self._opened[os.fstat(theirs.fileno()).st_ino] = file, mine
            self._poller.register(mine, 0)  # reports only the hang-up
            self._listener.answer_with_descriptor(
                call, theirs.fileno(), number, close_on_exec=close_on_exec
            )

    def _free_number(self, pid: int) -> int:
        free = set(self._descriptors) - {int(name) for name in os.listdir(f"/proc/{pid}/fd")}
        if not free:
            raise OSError(errno.EMFILE, f"{DESCRIPTORS} device files are already open")
        return min(free)

    def _stat(
        self, call: Notification, found: Found, buffer: int, *, extended: bool = False
    ) -> None:
        if found is Found.LISTING:  # i2c-tools only read it
            self._listener.continue_call(call)
            return
        node = self._node
        data = node.statx() if extended else node.stat(compact=self._abi.compact_stat)
        write_memory(call.pid, call.arguments[buffer], data)
        self._listener.answer(call, 0)

    def _stat_at(
        self, call: Notification, flags: int, handle: Callable[[Notification, Found], None]
    ) -> None:
        if call.arguments[flags] & AT_EMPTY_PATH:
            with contextlib.suppress(OSError):
                if not read_text(call.pid, call.arguments[1], 1):
                    self._on_file(call, lambda call, _file: handle(call, Found.DEVICE))
                    return
        self._on_path(call, folder=0, path=1, handle=handle)

    def _end(self, call: Notification, _found: Found, result: int) -> None:
        self._listener.answer(call, result)

    # --- by descriptor ------------------------------------------------------------------------

    def _by_descriptor(self) -> dict[str, Handler]:
        calls: dict[str, Callable[[Notification], marshal.Marshalled]] = {
            "ioctl": marshal.ioctl,
            "read": marshal.read,
            "write": marshal.write,
            "readv": partial(marshal.read, vector=True),
            "writev": partial(marshal.write, vector=True),
        }
        named: dict[str, Handler] = {
            name: partial(self._on_file, handle=partial(self._perform, fetch=fetch))
            for name, fetch in calls.items()
        }
        stat = partial(self._stat, found=Found.DEVICE, buffer=1)
        named["fstat"] = partial(self._on_file, handle=lambda call, _file: stat(call))
        named["dup"] = named["fcntl"] = partial(self._on_file, handle=self._duplicate)
        return named

    def _on_file(
        self, call: Notification, handle: Callable[[Notification, OpenFile], None]
    ) -> None:
        """Handle a call if its descriptor, argument 0, is ours."""
        try:
            inode = os.stat(f"/proc/{call.pid}/fd/{_signed(call.arguments[0])}").st_ino
        except OSError:
            inode = 0
        if inode not in self._opened:
            self._listener.continue_call(call)
        else:
            handle(call, self._opened[inode][0])

    def _perform(
        self,
        call: Notification,
        file: OpenFile,
        fetch: Callable[[Notification], marshal.Marshalled],
    ) -> None:
        marshalled = fetch(call)

        def done(reply: bytes) -> None:
            self._transfers -= 1
            result, data = split_reply(reply)
            if not self._listener.waits(call):
                return
            try:
                result = marshalled.finish(result, data)
            except OSError as error:
                result = -(error.errno or errno.EIO)
            self._listener.answer(call, result)

        self._transfers += 1
        file.perform(marshalled.call, marshalled.body, done)

    def _duplicate(self, call: Notification, _file: OpenFile) -> None:
        """Give a copy a descriptor in the filter's range, whatever number was requested."""
        fd = _take_descriptor(call.pid, _signed(call.arguments[0]))
        try:
            with_command = call.number == self._abi.calls["fcntl"]
            close_on_exec = with_command and call.arguments[1] == F_DUPFD_CLOEXEC
            number = self._free_number(call.pid)
            self._listener.answer_with_descriptor(call, fd, number, close_on_exec=close_on_exec)
        finally:
            os.close(fd)


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


def _signed(argument: int) -> int:
    return (argument & 0xFFFF_FFFF ^ 1 << 31) - (1 << 31)
