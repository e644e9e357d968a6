"""Reading another process's memory, here this process's own; answers, to a kernel of the test's."""

import ctypes
import errno
import fcntl
import mmap
import os
import struct
from collections.abc import Iterator

import pytest

from cubestack.emulator.i2cdev.seccomp.notify import Listener, Notification, read_text

PROT_NONE = 0


@pytest.fixture
def end_of_page() -> Iterator[int]:
    """The address behind three readable pages of 'x', where nobody may read."""
    with mmap.mmap(-1, 4 * mmap.PAGESIZE) as memory:
        memory[: 3 * mmap.PAGESIZE] = b"x" * (3 * mmap.PAGESIZE)
        first = ctypes.c_char.from_buffer(memory)
        end = ctypes.addressof(first) + 3 * mmap.PAGESIZE
        protect = ctypes.CDLL(None, use_errno=True).mprotect
        page = ctypes.c_void_p(end), ctypes.c_size_t(mmap.PAGESIZE)
        assert protect(*page, PROT_NONE) == 0
        yield end
        assert protect(*page, mmap.PROT_READ | mmap.PROT_WRITE) == 0
        del first


@pytest.mark.parametrize("length", [0, 1, 255, 256, 300, 5000])
def test_a_text_that_ends_with_its_page(end_of_page: int, length: int) -> None:
    ctypes.memset(end_of_page - 1, 0, 1)
    assert read_text(os.getpid(), end_of_page - 1 - length, 8192) == b"x" * length


def test_a_text_is_cut_at_the_limit(end_of_page: int) -> None:
    assert read_text(os.getpid(), end_of_page - 5000, 4999) == b"x" * 4999


def test_text_that_crosses_into_unmapped_memory_is_rejected(end_of_page: int) -> None:
    with pytest.raises(OSError, match="process") as caught:
        read_text(os.getpid(), end_of_page - 9, 8192)
    assert caught.value.errno == errno.EFAULT


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EBADF])
def test_call_fails_with_the_reason_when_its_descriptor_cannot_be_installed(
    monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    answers: list[tuple[int, ...]] = []

    def ioctl(_fd: int, request: int, argument: object) -> None:
        if request & 0xFF == 3:  # SECCOMP_IOCTL_NOTIF_ADDFD
            raise OSError(number, os.strerror(number))
        if isinstance(argument, bytes):  # struct seccomp_notif_resp: id, val, error, flags
            answers.append(struct.unpack("=QqiI", argument))

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    call = Notification(7, os.getpid(), 257, (0,) * 6)
    Listener(-1).answer_with_descriptor(call, 4, 960, close_on_exec=False)
    assert answers == [(7, 0, -number, 0)]
