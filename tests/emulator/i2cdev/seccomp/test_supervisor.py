"""A program's calls on the device file, one by one: this very process is the program."""

import contextlib
import ctypes
import errno
import os
import stat
import struct
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.seccomp import path_calls, supervisor
from cubestack.emulator.i2cdev.seccomp.abi import native_abi
from cubestack.emulator.i2cdev.seccomp.notify import Notification
from cubestack.firmware_model.formats import i2c_socket


@pytest.mark.parametrize("value", [0, 1, 3, 100, 2**31 - 1, -1, -100, -(2**31)])
def test_int_argument_is_taken_from_the_low_32_bits(value: int) -> None:
    for rest in (0, 0xFFFF_FFFF, 0x1234_5678):
        assert path_calls.signed(rest << 32 | value & 0xFFFF_FFFF) == value


class File:
    def __init__(self) -> None:
        self.asked: list[tuple[i2c_socket.Call, bytes]] = []
        self.waiting: list[Callable[[bytes], None]] = []
        self.result, self.data, self.closed = 0, b"", False
        self.late = False
        self.results: list[int] = []  #: of the next calls, instead of ``result``

    def perform(self, call: i2c_socket.Call, body: bytes, done: Callable[[bytes], None]) -> None:
        self.asked.append((call, body))
        if self.results:
            done(i2c_socket.reply(self.results.pop(0)))
        elif self.late:
            self.waiting.append(done)
        else:
            done(i2c_socket.reply(self.result, self.data))

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
        self, call: Notification, fd: int, number: int | None, *, close_on_exec: bool
    ) -> None:
        self.copies.append(os.dup(fd))
        self.answers[call.id] = number, close_on_exec, self.copies[-1]


class Program:
    def __init__(self) -> None:
        abi = native_abi()
        assert abi is not None
        self.abi, self.kernel, self.files = abi, Kernel(), list[File]()
        self.node = DeviceNode(7)
        self.supervisor = supervisor.Supervisor(
            self.kernel,
            abi,
            self.node,
            self._open,  # type: ignore[arg-type]
        )
        self._kept: list[Any] = []
        self._count = 0

    def _open(self, _flags: int) -> File:
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

    for _ in range(2):
        number, close_on_exec, fd = call(OURS, flags)
        assert (number, close_on_exec) == (None, bool(flags & os.O_CLOEXEC))
        assert stat.S_ISSOCK(os.fstat(fd).st_mode)
    assert len(program.files) == 2
    assert call(OTHER, flags) == "pass"
    assert call(OURS, flags | os.O_DIRECTORY) == -errno.ENOTDIR
    number, close_on_exec, fd = call(LISTING, flags)
    assert close_on_exec is bool(flags & os.O_CLOEXEC)
    assert os.pread(fd, 1000, 0).decode() == program.node.listing
    assert len(program.files) == 2


def test_removed_bus_returns_an_error(program: Program) -> None:
    def refuse(_flags: int) -> File:
        raise OSError(errno.ECONNREFUSED, "gone")

    program.supervisor._files = refuse
    assert program("openat", -100, program.memory(OURS), 0) == -errno.ENODEV


def test_file_does_not_become_a_standard_stream(
    program: Program, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.path.lexists
    monkeypatch.setattr(os.path, "lexists", lambda path: not path.endswith("/0") and real(path))
    number, *_ = program("openat", -100, program.memory(OURS), os.O_RDWR)
    assert number >= 3
    assert number not in {int(name) for name in os.listdir("/proc/self/fd")}


def test_open_beyond_the_limit_of_descriptors_returns_enfile(
    program: Program, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "has_room", lambda _descriptor: False)
    assert program("openat", -100, program.memory(OURS), 0) == -errno.ENFILE
    assert program.files[0].closed


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
    assert program("read", fd, place, 3) == 3
    assert ctypes.string_at(place, 8) == b"abc" + bytes(5)
    assert program("write", fd, program.memory(b"hello"), 3) == 3
    assert program("pread64", fd, place, 3, 99) == 3
    assert program("pwrite64", fd, place, 3, 99) == 3
    assert program("pread64", fd, place, 3, -1) == -errno.EINVAL
    assert program("read", fd, 8, 8) == -errno.EFAULT  # where nothing is
    assert program("write", fd, 8, 8) == -errno.EFAULT
    read, write = (i2c_socket.Call.READ, i2c_socket.pack_read(3)), (i2c_socket.Call.WRITE, b"abc")
    assert file.asked[:4] == [read, (i2c_socket.Call.WRITE, b"hel"), read, write]
    assert program("read", 0, place, 8) == "pass"
    assert program("read", 99_999, place, 8) == "pass"


@pytest.mark.parametrize(
    ("name", "rest"), [("v", ()), ("preadv", (99, 0)), ("preadv2", (-1, 0, 1))]
)
def test_parts_of_a_vector_are_calls_of_their_own(
    program: Program, name: str, rest: tuple[int, ...]
) -> None:
    reading, writing = ("readv", "writev") if name == "v" else (name, name.replace("read", "write"))
    fd = program.opened()
    (file,), place = program.files, program.memory(b"abcdefgh")
    parts = program.memory(struct.pack("=8Q", place, 3, 1, 0, place + 3, 5, 1, 0))

    def asked() -> list[tuple[i2c_socket.Call, bytes]]:
        calls, file.asked = file.asked, []
        return calls

    file.results = [3, 0, 5]  # the empty part at the end is none
    assert program(writing, fd, parts, 4, *rest) == 8
    assert asked() == [(i2c_socket.Call.WRITE, data) for data in (b"abc", b"", b"defgh")]
    file.results = [3, 0, 4]
    assert program(reading, fd, parts, 4, *rest) == 7
    assert asked() == [(i2c_socket.Call.READ, i2c_socket.pack_read(count)) for count in (3, 0, 5)]
    for results, expected, calls in (([2], 2, 1), ([-6], -6, 1), ([3, -6], 3, 2)):
        file.results = results  # short, failed at once, failed later
        assert program(writing, fd, parts, 4, *rest) == expected
        assert len(asked()) == calls
    assert program(reading, fd, parts, 1025, *rest) == -errno.EINVAL
    assert program(reading, fd, program.memory(struct.pack("=2Q", 1, 0)), 1, *rest) == 0
    assert (
        program(reading, fd, program.memory(struct.pack("=Qq", 1, -1)), 1, *rest) == -errno.EINVAL
    )
    if len(rest) > 1:
        assert program(reading, fd, parts, 4, -2) == -errno.EINVAL
    if len(rest) > 2:
        assert program(reading, fd, parts, 4, 0, 0, 8) == -errno.EOPNOTSUPP
    assert asked() == []


def test_late_answers_are_passed_on_unless_the_caller_was_killed(program: Program) -> None:
    fd = program.opened()
    (file,) = program.files
    file.late = True
    assert program("read", fd, program.memory(bytes(4)), 4) is None
    file.waiting.pop()(i2c_socket.reply(-errno.ENXIO, b""))
    assert program.kernel.answers[2] == -errno.ENXIO
    assert program("read", fd, program.memory(bytes(4)), 4) is None
    program.kernel.killed = True  # meanwhile
    file.waiting.pop()(i2c_socket.reply(1, b"x"))
    assert 3 not in program.kernel.answers


@pytest.mark.parametrize(
    ("name", "arguments", "close_on_exec"),
    [("dup", (), False), ("fcntl", (0, 0), False), ("fcntl", (1030, 0), True)],
)
def test_duplicated_descriptor_refers_to_the_same_file(
    program: Program, name: str, arguments: tuple[int, ...], close_on_exec: bool
) -> None:
    fd = program.opened()
    number, mode, copy = program(name, fd, *arguments)
    assert (number, mode) == (None, close_on_exec)
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
