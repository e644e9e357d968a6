"""The filter, run by an interpreter of its own; its launcher and notifications, to fake kernels."""

import ctypes
import errno
import fcntl
import mmap
import os
import re
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.i2cdev.seccomp import launcher
from cubestack.emulator.i2cdev.seccomp.abi import ABIS, Abi
from cubestack.emulator.i2cdev.seccomp.filter import ALWAYS, ON_DESCRIPTOR, ON_PATH, make_filter
from cubestack.emulator.i2cdev.seccomp.notify import Listener, Notification, read_text
from cubestack.firmware_model.formats.linux_i2c import Ioctl

ALLOW, NOTIFY, NO_SUCH_CALL = 0x7FFF0000, 0x7FC00000, 0x50000 | errno.ENOSYS


def decide(abi: Abi, call: int, *arguments: int, arch: int | None = None) -> int:
    """The filter's return value, by the classic BPF instructions that it uses."""
    data = struct.pack("<iIQ", call, abi.audit_arch if arch is None else arch, 0)
    data += struct.pack("<6Q", *(n & (1 << 64) - 1 for n in (*arguments, *[0] * 6)[:6]))
    program = list(struct.iter_unpack("=HBBI", make_filter(abi)))
    position = accumulator = 0
    while True:
        code, if_true, if_false, operand = program[position]
        position += 1
        match code:
            case 0x20:
                accumulator = struct.unpack_from("<I", data, operand)[0]
            case 0x15:
                position += if_true if accumulator == operand else if_false
            case 0x35:
                position += if_true if accumulator >= operand else if_false
            case 0x45:
                position += if_true if accumulator & operand else if_false
            case 0x06:
                return int(operand)
            case _:
                raise AssertionError(f"no such step: {code:#x}")


@pytest.fixture(params=ABIS.values(), ids=ABIS)
def abi(request: pytest.FixtureRequest) -> Abi:
    return request.param


def test_filter_notifies_all_calls_with_a_path(abi: Abi):
    assert len(make_filter(abi)) // 8 < 255  # jumps fit
    for name in abi.calls.keys() & {*ON_PATH, *ALWAYS}:
        assert decide(abi, abi.calls[name], 3, 0x1000) == NOTIFY, name


def test_filter_notifies_only_ioctls_of_i2c_and_those_that_only_sockets_have(abi: Abi):
    ours = {*map(int, Ioctl), 0x541B, 0x5411, 0x5452, *range(0x8900, 0x8A00)}
    for number in [*range(0x06F0, 0x0740), 0x5401, 0x10703, 0xC0020703, *ours, 0x88FF, 0x8A00]:
        expected = NOTIFY if number in ours else ALLOW
        assert decide(abi, abi.calls["ioctl"], 5, number) == expected, hex(number)
    # Some programs sign-extend the request.
    assert decide(abi, abi.calls["ioctl"], 5, 0xFFFFFFFF_00000703) == NOTIFY


@pytest.mark.parametrize("number", [-1, 0, 1, 2, 3, 4, 959, 10_000, 2**31 - 1, 2**31])
def test_filter_notifies_calls_on_all_but_the_standard_streams(abi: Abi, number: int):
    expected = NOTIFY if 3 <= number < 2**31 else ALLOW
    for name in abi.calls.keys() & set(ON_DESCRIPTOR):
        assert decide(abi, abi.calls[name], number) == expected, name
    assert decide(abi, abi.calls["epoll_ctl"], 9, 1, number) == expected
    assert decide(abi, abi.calls["epoll_ctl"], 9, 2, 5) == ALLOW  # EPOLL_CTL_DEL


@pytest.mark.parametrize(
    ("command", "sent"), [(0, True), (1030, True), (3, True), (1, False), (4, False)]
)
def test_filter_notifies_fcntl_of_the_mode_and_duplication_to_standard_streams(
    abi: Abi, command: int, sent: bool
):
    assert decide(abi, abi.calls["fcntl"], 970, command, 0) == (NOTIFY if sent else ALLOW)
    assert decide(abi, abi.calls["fcntl"], 970, command, 3) == (NOTIFY if command == 3 else ALLOW)
    assert decide(abi, abi.calls["fcntl"], 1, command) == ALLOW


def test_filter_notifies_duplication_onto_standard_streams_only(abi: Abi):
    for name in abi.calls.keys() & {"dup2", "dup3"}:
        assert decide(abi, abi.calls[name], 7, 2) == NOTIFY
        assert decide(abi, abi.calls[name], 7, 3) == ALLOW


def test_io_uring_does_not_exist(abi: Abi):
    assert decide(abi, abi.calls["io_uring_setup"], 8, 0x1000) == NO_SUCH_CALL


def test_filter_notifies_newfstatat_with_an_empty_path(abi: Abi):
    call = abi.calls["newfstatat"]
    assert decide(abi, call, 970, 0x1000, 0x2000, 0x1000) == NOTIFY
    assert decide(abi, call, 1, 0x1000, 0x2000, 0x1000) == ALLOW
    assert decide(abi, call, 1, 0x1000, 0x2000, 0x100) == NOTIFY  # a path


def test_filter_allows_all_other_system_calls(abi: Abi):
    for call in set(range(450)) - set(abi.calls.values()):
        assert decide(abi, call, 970, 0x0703) == ALLOW, call
    # Other processors, and their numbers.
    assert decide(abi, abi.calls["openat"], arch=0x40000003) == ALLOW  # i386
    assert decide(abi, abi.calls["openat"] | 0x40000000) == ALLOW  # x32


@pytest.mark.parametrize(
    ("machines", "header"),
    [
        (("x86_64",), "x86_64-linux-gnu/asm/unistd_64.h"),
        (("aarch64", "riscv64"), "asm-generic/unistd.h"),
    ],
)
def test_system_call_numbers_equal_the_kernel_headers(machines: tuple[str, ...], header: str):
    path = Path("/usr/include", header)
    if not path.exists():
        pytest.skip(f"no {path}")
    text = path.read_text()
    numbers = re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", text)
    found = {name: int(number) for name, number in numbers}
    found.setdefault("newfstatat", found.get("fstatat", -1))  # by a macro
    for machine in machines:
        abi = ABIS[machine]
        calls = {**abi.calls, "seccomp": abi.seccomp}
        assert calls == {name: found[name] for name in calls}


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
def test_text_that_ends_at_a_page_boundary_is_read(end_of_page: int, length: int) -> None:
    ctypes.memset(end_of_page - 1, 0, 1)
    assert read_text(os.getpid(), end_of_page - 1 - length, 8192) == b"x" * length


def test_text_is_cut_at_the_limit(end_of_page: int) -> None:
    assert read_text(os.getpid(), end_of_page - 5000, 4999) == b"x" * 4999


def test_text_that_crosses_into_unmapped_memory_is_rejected(end_of_page: int) -> None:
    with pytest.raises(OSError, match="process") as caught:
        read_text(os.getpid(), end_of_page - 9, 8192)
    assert caught.value.errno == errno.EFAULT


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EBADF])
def test_call_fails_with_the_reason_when_its_descriptor_cannot_be_installed(
    monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def ioctl(_fd: int, request: int, argument: object, _mutate: bool = True) -> None:
        if request & 0xFF == 3:  # SECCOMP_IOCTL_NOTIF_ADDFD
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    call = Notification(7, os.getpid(), 257, (0,) * 6)
    with pytest.raises(OSError, match=r"open files|Bad|limit") as caught:
        Listener(-1).answer_with_descriptor(call, 4, 960, close_on_exec=False)
    assert caught.value.errno == (errno.EMFILE if number == errno.EBADF else number)


STEPS = bytes(range(1, 25))
CALL = 317


class Libc:
    """Records calls; ``fails`` names those that fail, ``flags`` are the supported flags."""

    def __init__(self, fails: str = "", flags: tuple[int, ...] = (8 | 32, 8)) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.fails, self.flags = fails, flags

    def prctl(self, *arguments: int) -> int:
        self.calls.append(arguments)
        ctypes.set_errno(errno.EACCES)
        return -1 if self.fails == "prctl" else 0

    def syscall(self, number: int, mode: int, flags: int, program: Any) -> int:
        made = program._obj
        self.calls.append((number, mode, flags, made.steps[: 8 * made.length]))
        ctypes.set_errno(errno.EBUSY)
        return 7 if flags in self.flags else -1


def install(libc: Libc) -> int:
    return launcher.install(libc, CALL, STEPS)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("flags", "tried"), [((40, 8), [40]), ((8,), [40, 8])], ids=["linux-5.19", "before"]
)
def test_kernel_returns_a_listener(flags: tuple[int, ...], tried: list[int]) -> None:
    """PR_SET_NO_NEW_PRIVS is 38, SECCOMP_SET_MODE_FILTER 1; flags as in linux/seccomp.h."""
    libc = Libc(flags=flags)
    assert install(libc) == 7
    assert libc.calls == [(38, 1, 0, 0, 0), *((CALL, 1, flag, STEPS) for flag in tried)]


def test_reports_kernel_errors() -> None:
    with pytest.raises(OSError, match="can not set no_new_privs") as caught:
        install(Libc("prctl"))
    assert caught.value.errno == errno.EACCES
    with pytest.raises(OSError, match=r"the kernel refuses a seccomp listener \(.*busy") as caught:
        install(Libc(flags=()))
    assert caught.value.errno == errno.EBUSY
    zero = Libc()
    zero.syscall = lambda *_arguments: 0  # type: ignore[method-assign]
    assert install(zero) == 0


def test_program_starts_after_listener_handover(monkeypatch: pytest.MonkeyPatch) -> None:
    """The filter comes over the socket; what goes back leads to the same pipe."""
    link, theirs = socket.socketpair()
    reader, listener = os.pipe()
    libc, started = Libc(), []
    libc.syscall = lambda *_arguments: listener  # type: ignore[method-assign]
    monkeypatch.setattr(launcher.socket, "socket", lambda fileno: theirs)
    monkeypatch.setattr(launcher.ctypes, "CDLL", lambda *_arguments, **_options: libc)
    monkeypatch.setattr(launcher.signal, "signal", lambda *_arguments: None)
    monkeypatch.setattr(launcher.os, "execvp", lambda *command: started.append(command))
    monkeypatch.setattr(launcher.os, "_exit", lambda _code: None)
    with link, theirs, open(reader, "rb") as pipe:
        link.send(STEPS)
        launcher.main(str(theirs.fileno()), str(CALL), "program", "argument")
        link.setblocking(False)
        text, given, *_ = socket.recv_fds(link, 10, 1)
        with open(given[0], "wb") as end:
            end.write(b"x")
        assert (text, pipe.read(), started) == (b"+", b"x", [("program", ("program", "argument"))])
