"""Seccomp user notification: the calls of a filtered process, and their results.

See linux/seccomp.h; installing descriptors in the process needs Linux 5.9.
"""

import ctypes
import errno
import fcntl
import os
import struct
from collections.abc import Callable
from typing import NamedTuple

from cubestack.emulator.i2cdev.pacing import has_priority

_RECEIVE = 0xC050_2100
_SEND = 0xC018_2101
_VALID = 0x4008_2102
_SET_FLAGS = 0x4008_2104
_ADD_DESCRIPTOR = 0x4018_2103

_NOTIFICATION = struct.Struct("=QIIiIQ6Q")
_RESPONSE = struct.Struct("=QqiI")
_ADDITION = struct.Struct("=QIIII")
_ID = struct.Struct("=Q")

_CONTINUE = 1
_AT_NUMBER = 1
_AND_SEND = 2

_SAME_PROCESSOR = 1  # SECCOMP_USER_NOTIF_FD_SYNC_WAKE_UP

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
CHUNK_BYTES = 256  # most paths are shorter


class Notification(NamedTuple):
    """A system call that waits for the supervisor's answer."""

    id: int  # identifies the call in the answer
    pid: int  # calling thread
    number: int  # number of the system call
    arguments: tuple[int, ...]  # its six arguments


class Listener:
    """The supervisor's end of a filter.

    Attributes:
        fd: descriptor; readable while a call is pending, hung up when all processes have ended.
        shares_processor: whether a caller and this process wake each other on the same processor.
            Waking up on another one would take longer than the rest of a call, except for a process
            that busy-waits with real-time priority.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._can_add_and_send = True
        self.shares_processor = not has_priority() and self._share_processor()

    def _share_processor(self) -> bool:
        """Request wake-ups on the same processor; returns whether that is supported."""
        try:
            fcntl.ioctl(self.fd, _SET_FLAGS, _SAME_PROCESSOR)
        except OSError:  # before Linux 6.6
            return False
        return True

    def receive(self) -> Notification | None:
        """Wait for the next call; None if its process was killed meanwhile."""
        buffer = bytearray(_NOTIFICATION.size)
        try:
            fcntl.ioctl(self.fd, _RECEIVE, buffer, True)
        except OSError as error:
            if error.errno in (errno.ENOENT, errno.EINTR):
                return None
            raise
        identifier, pid, _, number, _, _, *arguments = _NOTIFICATION.unpack(buffer)
        return Notification(identifier, pid, number, tuple(arguments))

    def waits(self, call: Notification) -> bool:
        """Whether the caller still waits, so that its process ID is still valid."""
        try:
            fcntl.ioctl(self.fd, _VALID, _ID.pack(call.id))
        except OSError:
            return False
        return True

    def continue_call(self, call: Notification) -> None:
        """Let the kernel perform the call as without a filter."""
        self._send(_RESPONSE.pack(call.id, 0, 0, _CONTINUE))

    def answer(self, call: Notification, result: int) -> None:
        """End the call with ``result``: 0 or more, or a negative errno."""
        self._send(_RESPONSE.pack(call.id, max(0, result), min(0, result), 0))

    def answer_with_descriptor(
        self, call: Notification, fd: int, number: int | None, *, close_on_exec: bool
    ) -> None:
        """Install a copy of ``fd`` in the process, whose number the call returns.

        ``number`` None: the lowest free one. Raises OSError, EMFILE at the process's limit.
        """
        how = 0 if number is None else _AT_NUMBER
        how |= _AND_SEND if self._can_add_and_send else 0
        flags = os.O_CLOEXEC if close_on_exec else 0
        addition = bytearray(_ADDITION.pack(call.id, how, fd, number or 0, flags))
        try:
            installed = fcntl.ioctl(self.fd, _ADD_DESCRIPTOR, addition, True)
        except OSError as error:
            if error.errno == errno.ENOENT:  # killed meanwhile
                return
            if error.errno == errno.EBADF and number is not None:
                raise OSError(errno.EMFILE, f"{number} is above the process's limit") from None
            if not self._can_add_and_send or error.errno != errno.EINVAL:
                raise
            self._can_add_and_send = False  # before Linux 5.14
            self.answer_with_descriptor(call, fd, number, close_on_exec=close_on_exec)
        else:
            if not self._can_add_and_send:
                self.answer(call, installed)

    def _send(self, response: bytes) -> None:
        try:
            fcntl.ioctl(self.fd, _SEND, response)
        except OSError as error:
            if error.errno != errno.ENOENT:  # killed meanwhile
                raise


class _Part(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


_libc = ctypes.CDLL(None, use_errno=True)
_VECTOR = (ctypes.c_void_p, ctypes.c_ulong)
_readv, _writev = _libc.process_vm_readv, _libc.process_vm_writev
for _function in (_readv, _writev):
    _function.argtypes = (ctypes.c_int, *_VECTOR, *_VECTOR, ctypes.c_ulong)
    _function.restype = ctypes.c_ssize_t


class _Window:
    """Copies bytes between this process and another one, with a reused buffer."""

    SIZE = 1 << 14

    def __init__(self) -> None:
        self._buffer = ctypes.create_string_buffer(self.SIZE)
        self._view = memoryview(self._buffer).cast("B")
        self._local = _Part(ctypes.addressof(self._buffer), 0)
        self._remote = _Part(0, 0)
        self._parts = ctypes.byref(self._local), ctypes.byref(self._remote)

    def read(self, pid: int, address: int, count: int) -> bytes:
        """At most ``SIZE`` bytes of a process's memory; raises OSError, EFAULT if unmapped."""
        if count:
            self._move(_readv, pid, address, count)
        return self._view[:count].tobytes()

    def write(self, pid: int, address: int, data: bytes) -> None:
        """Write at most ``SIZE`` bytes to a process's memory; raises OSError as ``read``."""
        if data:
            self._view[: len(data)] = data
            self._move(_writev, pid, address, len(data))

    def _move(self, function: Callable[..., int], pid: int, address: int, count: int) -> None:
        self._local.length = self._remote.length = count
        self._remote.base = address
        here, there = self._parts
        done = function(pid, here, 1, there, 1, 0)
        if done < 0:
            number = ctypes.get_errno()
            raise OSError(number, f"no access to process {pid}: {os.strerror(number)}")
        if done != count:
            raise OSError(errno.EFAULT, f"process {pid} has no {count} bytes at {address:#x}")


_window = _Window()
read_memory, write_memory = _window.read, _window.write


def read_text(pid: int, address: int, limit: int) -> bytes:
    """The bytes before the next zero byte, at most ``limit``; raises OSError."""
    text = b""
    while len(text) < limit:
        rest_of_page = PAGE_BYTES - address % PAGE_BYTES
        count = min(rest_of_page, CHUNK_BYTES, limit - len(text))
        part = read_memory(pid, address, count)
        end = part.find(0)
        if end >= 0:
            return text + part[:end]
        text += part
        address += count
    return text
