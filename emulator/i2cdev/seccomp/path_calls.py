"""Calls of a filtered program that name the device file by a path."""

import contextlib
import errno
import os
import stat
import struct
from collections.abc import Callable
from functools import partial
from typing import Protocol

from cubestack.emulator.i2cdev.device_node import MODE, DeviceNode, Found
from cubestack.emulator.i2cdev.seccomp.abi import Abi
from cubestack.emulator.i2cdev.seccomp.filter import AT_EMPTY_PATH
from cubestack.emulator.i2cdev.seccomp.notify import (
    Listener,
    Notification,
    read_memory,
    read_text,
    write_memory,
)

PATH_BYTES = 4096
AT_SYMLINK_NOFOLLOW = 0x100
HOW_BYTES = 24
"""Smallest struct open_how: flags, mode, resolve."""

RESOLVE_NO_SYMLINKS = 0x04
RESOLVE_BOUNDED = 0x01 | 0x08 | 0x10
"""RESOLVE_NO_XDEV, _BENEATH, _IN_ROOT: the kernel refuses such paths to /dev by itself."""

_HOW = struct.Struct("=QQQ")

Handler = Callable[[Notification], None]
Place = int
"""Number of an argument."""


class Opener(Protocol):
    """The table of opened device files."""

    def open_device(self, call: Notification, flags: int) -> None:
        """Open the device file, and end ``call`` with its descriptor."""

    def open_listing(self, call: Notification, flags: int) -> None:
        """Open ``LISTING``, and end ``call`` with its descriptor."""

    def is_device(self, pid: int, fd: int) -> bool:
        """Whether a descriptor of a process is a device file."""


class PathCalls:
    """Handlers of the calls with a path; those on other files are left to the kernel."""

    def __init__(self, listener: Listener, abi: Abi, node: DeviceNode, opener: Opener) -> None:
        self._listener = listener
        self._abi = abi
        self._node = node
        self._opener = opener

    def handlers(self) -> dict[str, Handler]:
        """By the names of the calls."""
        here = partial(self._on_path, folder=None, path=0)
        there = partial(self._on_path, folder=0, path=1)
        no_attribute = partial(self._end, result=-errno.EOPNOTSUPP)
        return {
            "open": partial(self._open, folder=None, path=0, flags=1),
            "creat": partial(
                self._open, folder=None, path=0, given=os.O_CREAT | os.O_WRONLY | os.O_TRUNC
            ),
            "openat": partial(self._open, folder=0, path=1, flags=2),
            "openat2": self._openat2,
            "stat": partial(here, handle=partial(self._stat, buffer=1)),
            "lstat": partial(here, handle=partial(self._stat, buffer=1), follow=False),
            "newfstatat": partial(self._stat_at, flags=3, handle=partial(self._stat, buffer=2)),
            "statx": partial(
                self._stat_at, flags=2, handle=partial(self._stat, buffer=4, extended=True)
            ),
            "access": partial(here, handle=partial(self._access, how=1)),
            "faccessat": partial(there, handle=partial(self._access, how=2)),
            "faccessat2": partial(there, handle=partial(self._access, how=2)),
            "readlink": partial(self._readlink, folder=None, path=0),
            "readlinkat": partial(self._readlink, folder=0, path=1),
            "getxattr": partial(here, handle=no_attribute),
            "lgetxattr": partial(here, handle=no_attribute, follow=False),
        }

    def _text(self, call: Notification, path: Place) -> str:
        try:
            return os.fsdecode(read_text(call.pid, call.arguments[path], PATH_BYTES))
        except OSError:
            return ""  # the kernel will report the error

    def _find(
        self, call: Notification, folder: Place | None, path: Place, *, follow: bool
    ) -> Found | None:
        text = self._text(call, path)
        if not text:
            return None
        start = None if folder is None else signed(call.arguments[folder])
        return self._node.find(text, call.pid, start, follow=follow, is_ours=self._opener.is_device)

    def _on_path(
        self,
        call: Notification,
        folder: Place | None,
        path: Place,
        handle: Callable[[Notification, Found], None],
        *,
        follow: bool = True,
    ) -> None:
        """Handle a call if its path is ours."""
        found = self._find(call, folder, path, follow=follow)
        if found is None:
            self._listener.continue_call(call)
        else:
            handle(call, found)

    def _open(
        self,
        call: Notification,
        folder: Place | None,
        path: Place,
        flags: Place = 0,
        given: int | None = None,
    ) -> None:
        chosen = call.arguments[flags] & 0xFFFF_FFFF if given is None else given
        found = self._find(call, folder, path, follow=not chosen & os.O_NOFOLLOW)
        if found is None:
            self._listener.continue_call(call)
        else:
            self._open_found(call, found, chosen)

    def _openat2(self, call: Notification) -> None:
        resolve = flags = 0
        with contextlib.suppress(OSError):
            flags, _, resolve = _HOW.unpack(read_memory(call.pid, call.arguments[2], HOW_BYTES))
        follow = not flags & os.O_NOFOLLOW and not resolve & RESOLVE_NO_SYMLINKS
        found = None
        if call.arguments[3] >= HOW_BYTES and not resolve & RESOLVE_BOUNDED:
            found = self._find(call, 0, 1, follow=follow)
        if found is None:
            self._listener.continue_call(call)
        else:
            self._open_found(call, found, flags)

    def _open_found(self, call: Notification, found: Found, flags: int) -> None:
        """Open it, or raise OSError, in the order of checks of fs/namei.c."""
        if flags & os.O_CREAT and flags & os.O_EXCL and not flags & os.O_PATH:
            raise OSError(errno.EEXIST, f"{self._node.path} exists")
        if flags & os.O_DIRECTORY:
            raise OSError(errno.ENOTDIR, f"{self._node.path} is not a folder")
        if flags & os.O_DIRECT and not flags & os.O_PATH:
            raise OSError(errno.EINVAL, f"{self._node.path} has no direct I/O")
        if found is Found.LISTING:
            self._opener.open_listing(call, flags)
        else:
            self._opener.open_device(call, flags)

    def _stat(
        self, call: Notification, found: Found, buffer: Place, *, extended: bool = False
    ) -> None:
        if found is Found.LISTING:  # i2c-tools only read it
            self._listener.continue_call(call)
            return
        node = self._node
        data = node.statx() if extended else node.stat(compact=self._abi.compact_stat)
        write_memory(call.pid, call.arguments[buffer], data)
        self._listener.answer(call, 0)

    def fstat(self, call: Notification) -> None:
        """Of an opened device file."""
        self._stat(call, Found.DEVICE, buffer=1)

    def _stat_at(
        self, call: Notification, flags: Place, handle: Callable[[Notification, Found], None]
    ) -> None:
        if call.arguments[flags] & AT_EMPTY_PATH and not self._text(call, 1):
            if self._opener.is_device(call.pid, signed(call.arguments[0])):
                handle(call, Found.DEVICE)
            else:
                self._listener.continue_call(call)
            return
        follow = not call.arguments[flags] & AT_SYMLINK_NOFOLLOW
        self._on_path(call, folder=0, path=1, handle=handle, follow=follow)

    def _access(self, call: Notification, _found: Found, how: Place) -> None:
        wanted = call.arguments[how] & 0xFFFF_FFFF
        if wanted & ~(os.R_OK | os.W_OK | os.X_OK):
            raise OSError(errno.EINVAL, f"{wanted} is no way of access")
        if wanted & os.X_OK and not MODE & (stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH):
            raise OSError(errno.EACCES, f"{self._node.path} is not a program")
        self._listener.answer(call, 0)

    def _readlink(self, call: Notification, folder: Place | None, path: Place) -> None:
        if self._find(call, folder, path, follow=False) is not None:
            raise OSError(errno.EINVAL, f"{self._node.path} is not a link")
        if not self._node.is_own_link(self._text(call, path), call.pid, self._opener.is_device):
            self._listener.continue_call(call)
            return
        size = signed(call.arguments[path + 2])
        if size <= 0:
            raise OSError(errno.EINVAL, f"{size} is no size of a buffer")
        target = self._node.path.encode()[:size]
        write_memory(call.pid, call.arguments[path + 1], target)
        self._listener.answer(call, len(target))

    def _end(self, call: Notification, _found: Found, result: int) -> None:
        self._listener.answer(call, result)


def signed(argument: int) -> int:
    """An argument of type int; the kernel ignores its high half."""
    return (argument & 0xFFFF_FFFF ^ 1 << 31) - (1 << 31)
