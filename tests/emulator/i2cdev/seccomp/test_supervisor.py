"""A program's calls on the device file, one by one: this very process is the program."""

import contextlib
import ctypes
import errno
import os
import resource
import stat
import struct
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.seccomp import supervisor
from cubestack.emulator.i2cdev.seccomp.filter import native_abi
from cubestack.emulator.i2cdev.seccomp.notify import Notification
from cubestack.firmware_model.formats import linux_i2c as linux


@pytest.mark.parametrize(
    ("soft", "first", "end"),
    [
        (resource.RLIM_INFINITY, 960, 1024),
        (1 << 20, 960, 1024),
        (1025, 960, 1024),
        (1024, 960, 1024),
        (1023, 959, 1023),
        (256, 192, 256),
        (68, 4, 68),
        (67, 3, 67),
        (20, 3, 20),
    ],
)
def test_device_files_get_the_highest_descriptors_usable_by_select(
    monkeypatch: pytest.MonkeyPatch, soft: int, first: int, end: int
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (soft, soft))
    assert supervisor.descriptor_range() == range(first, end)


@pytest.mark.parametrize("value", [0, 1, 3, 100, 2**31 - 1, -1, -100, -(2**31)])
def test_int_argument_is_taken_from_the_low_32_bits(value: int) -> None:
    for rest in (0, 0xFFFF_FFFF, 0x1234_5678):
        assert supervisor._signed(rest << 32 | value & 0xFFFF_FFFF) == value


class File:
    def __init__(self) -> None:
        self.asked: list[tuple[linux.Call, bytes]] = []
        self.waiting: list[Callable[[bytes], None]] = []
        self.result, self.data, self.closed = 0, b"", False
        self.late = False

    def perform(self, call: linux.Call, body: bytes, done: Callable[[bytes], None]) -> None:
        self.asked.append((call, body))
        if self.late:
            self.waiting.append(done)
        else:
            done(linux.reply(self.result, self.data))

    def close(self) -> None:
        self.closed = True


class Kernel:
    """The listener's end of a filter; this very process is the filtered program.

    Attributes: the answer to each call: a result, "pass", or number, mode and a copy of what was
    put in.
    """

    shares_processor = False

    def __init__(self) -> None:
        self.fd = os.eventfd(0, os.EFD_SEMAPHORE)
        self.calls: list[Notification] = []
        self.answers: dict[int, Any] = {}
        self.copies: list[int] = []
        self.killed = False

    def receive(self) -> Notification | None:
        os.eventfd_read(self.fd)
        return self.calls.pop(0)

    def waits(self, call: Notification) -> bool:
        return not self.killed

    def continue_call(self, call: Notification) -> None:
        self.answers[call.id] = "pass"

    def answer(self, call: Notification, result: int) -> None:
        self.answers[call.id] = result

    def answer_with_descriptor(
        self, call: Notification, fd: int, number: int, *, close_on_exec: bool
    ) -> None:
        self.copies.append(os.dup(fd))
        self.answers[call.id] = number, close_on_exec, self.copies[-1]


class Program:
    def __init__(self, numbers: range = range(900, 904)) -> None:
        abi = native_abi()
        assert abi is not None
        self.abi, self.kernel, self.files = abi, Kernel(), list[File]()
        self.node = DeviceNode(7)
        self.supervisor = supervisor.Supervisor(
            self.kernel,
            abi,
            self.node,
            numbers,
            self._open,  # type: ignore[arg-type]
        )
        self._kept: list[Any] = []
        self._count = 0

    def _open(self) -> File:
        self.files.append(File())
        return self.files[-1]

    def memory(self, data: bytes) -> int:
        self._kept.append(ctypes.create_string_buffer(data, len(data)))
        return ctypes.addressof(self._kept[-1])

    def __call__(self, name: str, *arguments: int) -> Any:
        """The answer to a call; it is not there on this machine: skipped. None while it waits."""
        if name not in self.abi.calls:
            pytest.skip(f"no {name} here")
        self._count += 1
        values = tuple(argument & (1 << 64) - 1 for argument in (*arguments, *[0] * 6)[:6])
        call = Notification(self._count, os.getpid(), self.abi.calls[name], values)
        self.kernel.calls.append(call)
        os.eventfd_write(self.kernel.fd, 1)
        self.supervisor.exchange(0)
        return self.kernel.answers.get(self._count)

    def opened(self) -> int:
        *_, fd = self("openat", -100, self.memory(b"/dev/i2c-7\0"), os.O_RDWR)
        return int(fd)

    def close(self) -> None:
        for fd in self.kernel.copies:
            with contextlib.suppress(OSError):
                os.close(fd)
        self.supervisor.close()


@pytest.fixture
def program() -> Iterator[Program]:
    if native_abi() is None:
        pytest.skip("no filter for this machine")
    program = Program()
    yield program
    program.close()


OURS, OTHER, LISTING = b"/dev/i2c-7\0", b"/dev/i2c-8\0", b"/proc/bus/i2c\0"


@pytest.mark.parametrize("flags", [os.O_RDWR, os.O_RDWR | os.O_CLOEXEC])
@pytest.mark.parametrize("name", ["open", "openat", "openat2"])
def test_each_open_call_returns_the_device_file(program: Program, name: str, flags: int) -> None:
    def call(path: bytes, flags: int) -> Any:
        where, folder = program.memory(path), () if name == "open" else (-100,)
        how = program.memory(struct.pack("=3Q", flags, 0, 0)) if name == "openat2" else flags
        return program(name, *folder, where, how, 24)

    for expected in (900, 900):  # nobody puts it there here, so the number stays free
        number, close_on_exec, fd = call(OURS, flags)
        assert (number, close_on_exec) == (expected, bool(flags & os.O_CLOEXEC))
        assert stat.S_ISSOCK(os.fstat(fd).st_mode)
    assert len(program.files) == 2
    assert call(OTHER, flags) == "pass"
    assert call(OURS, flags | os.O_DIRECTORY) == -errno.ENOTDIR
    number, close_on_exec, fd = call(LISTING, flags)
    assert close_on_exec is bool(flags & os.O_CLOEXEC)
    assert os.pread(fd, 1000, 0).decode() == program.node.listing
    assert len(program.files) == 2


def test_removed_bus_returns_an_error(program: Program) -> None:
    def refuse() -> File:
        raise OSError(errno.ECONNREFUSED, "gone")

    program.supervisor._files = refuse
    assert program("openat", -100, program.memory(OURS), 0) == -errno.ENODEV


def test_open_without_a_free_descriptor_returns_emfile() -> None:
    taken = os.open("/dev/null", os.O_RDONLY)
    program = Program(range(taken, taken + 1))
    try:
        assert program("openat", -100, program.memory(OURS), 0) == -errno.EMFILE
    finally:
        program.close()
        os.close(taken)


@pytest.mark.parametrize(
    ("name", "arguments", "extended"),
    [
        ("stat", "pb", False),
        ("lstat", "pb", False),
        ("newfstatat", "fpb0", False),
        ("statx", "fp00b", True),
    ],
)
def test_each_stat_call_reports_the_device_file(
    program: Program, name: str, arguments: str, extended: bool
) -> None:
    buffer = program.memory(bytes(256))

    def call(path: bytes) -> Any:
        values = {"f": -100, "p": program.memory(path), "b": buffer, "0": 0}
        return program(name, *(values[letter] for letter in arguments))

    assert call(OTHER) == call(LISTING) == "pass"
    assert ctypes.string_at(buffer, 256) == bytes(256)
    assert call(OURS) == 0
    made = program.node.statx() if extended else program.node.stat(compact=program.abi.compact_stat)
    assert ctypes.string_at(buffer, len(made)) == made


@pytest.mark.parametrize(("name", "flags", "buffer"), [("newfstatat", 3, 2), ("statx", 2, 4)])
def test_stat_with_an_empty_path_reports_the_device_file(
    program: Program, name: str, flags: int, buffer: int
) -> None:
    fd, place = program.opened(), program.memory(bytes(256))

    def call(path: bytes, flag: int, fd: int = fd) -> Any:
        values = [fd, program.memory(path), 0, 0, 0]
        values[flags], values[buffer] = flag, place
        return program(name, *values)

    assert call(b"\0", 0) == "pass"
    assert call(b"\0", 0x1000, fd=0) == "pass"
    assert ctypes.string_at(place, 256) == bytes(256)
    assert call(b"\0", 0x1000) == 0
    assert ctypes.string_at(place, 256) != bytes(256)
    assert call(OURS, 0x1000) == 0  # the path counts where there is one
    assert call(OTHER, 0x1000) == "pass"
    made = program.memory(bytes(256))
    assert program("fstat", fd, made) == 0
    assert program("fstat", 0, made) == "pass"
    expected = program.node.stat(compact=program.abi.compact_stat)
    assert ctypes.string_at(made, len(expected)) == expected


@pytest.mark.parametrize(
    ("name", "folder", "result"),
    [
        ("access", False, 0),
        ("faccessat", True, 0),
        ("faccessat2", True, 0),
        ("readlink", False, -errno.EINVAL),
        ("readlinkat", True, -errno.EINVAL),
        ("getxattr", False, -errno.EOPNOTSUPP),
        ("lgetxattr", False, -errno.EOPNOTSUPP),
    ],
)
def test_path_query_calls_on_the_device_file_return_linux_results(
    program: Program, name: str, folder: bool, result: int
) -> None:
    before = (-100,) if folder else ()
    assert program(name, *before, program.memory(OURS)) == result
    assert program(name, *before, program.memory(OTHER)) == "pass"
    assert program(name, *before, 8) == "pass"  # no path: the kernel says so
    if folder:
        folder_fd = os.open("/dev", os.O_RDONLY)
        assert program(name, folder_fd, program.memory(b"i2c-7\0")) == result
        os.close(folder_fd)


def test_read_and_write_calls_reach_the_device_file(program: Program) -> None:
    fd = program.opened()
    (file,), place = program.files, program.memory(bytes(8))
    file.result, file.data = 3, b"abc"
    assert program("read", fd, place, 8) == 3
    assert ctypes.string_at(place, 8) == b"abc" + bytes(5)
    assert program("write", fd, program.memory(b"hello"), 4) == 3
    parts = struct.pack("=4Q", 1, 0, place, 5)  # the first one is empty
    assert program("readv", fd, program.memory(parts), 2) == 3
    assert program("writev", fd, program.memory(parts), 2) == 3
    assert program("writev", fd, program.memory(parts), 1025) == -errno.EINVAL
    assert program("read", fd, 8, 8) == -errno.EFAULT  # where nothing is
    assert program("write", fd, 8, 8) == -errno.EFAULT
    assert file.asked[:4] == [
        (linux.Call.READ, linux.pack_read(8)),
        (linux.Call.WRITE, b"hell"),
        (linux.Call.READ, linux.pack_read(5)),
        (linux.Call.WRITE, b"abc\0\0"),
    ]
    assert program("read", 0, place, 8) == "pass"
    assert program("read", 99_999, place, 8) == "pass"


def test_late_answers_are_passed_on_unless_the_caller_was_killed(program: Program) -> None:
    fd = program.opened()
    (file,) = program.files
    file.late = True
    assert program("read", fd, program.memory(bytes(4)), 4) is None
    file.waiting.pop()(linux.reply(-errno.ENXIO, b""))
    assert program.kernel.answers[2] == -errno.ENXIO
    assert program("read", fd, program.memory(bytes(4)), 4) is None
    program.kernel.killed = True  # meanwhile
    file.waiting.pop()(linux.reply(1, b"x"))
    assert 3 not in program.kernel.answers


@pytest.mark.parametrize(
    ("name", "arguments", "close_on_exec"),
    [("dup", (), False), ("fcntl", (0, 5), False), ("fcntl", (1030, 5), True)],
)
def test_duplicated_descriptor_refers_to_the_same_file(
    program: Program, name: str, arguments: tuple[int, ...], close_on_exec: bool
) -> None:
    fd = program.opened()
    number, mode, copy = program(name, fd, *arguments)
    assert (number, mode) == (900, close_on_exec)
    assert os.fstat(copy).st_ino == os.fstat(fd).st_ino
    assert program(name, 0, *arguments) == "pass"
    (file,) = program.files
    os.close(fd)
    program.supervisor.exchange(0)
    assert not file.closed
    os.close(copy)
    program.supervisor.exchange(0)
    assert file.closed


def test_supervisor_closes_open_files_at_the_end(program: Program) -> None:
    program.opened()
    program.opened()
    before = len(os.listdir("/proc/self/fd"))
    assert [number for number, _ in program.supervisor.watched()] != []
    program.supervisor.close()
    assert all(file.closed for file in program.files)
    assert len(os.listdir("/proc/self/fd")) == before - 4  # two ends, the poller, the listener
    program.supervisor = Program().supervisor
