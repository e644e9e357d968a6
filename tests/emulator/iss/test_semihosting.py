"""Semihosting: the calls of a program by BKPT 0xAB, and the host's answers."""

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.iss.machine import RAM_BASE, Machine
from cubestack.emulator.iss.outcome import OutgoingKind
from cubestack.emulator.iss.semihosting import FAILED, Exit, SemihostingHost

from .armv7m.thumb import Program

BLOCK, TEXT, OTHER = RAM_BASE + 0x100, RAM_BASE + 0x1000, RAM_BASE + 0x3000
S, US = 10**12, 10**6
DHCSR = 0xE000_EDF0


class Caller:
    """A program whose calls are made by hand, and its host."""

    def __init__(self, root: Path | None = None) -> None:
        self.machine = Machine()
        self.printed, self.typed = b"", b""
        self.waiting = False
        self.host = SemihostingHost(self.machine, root=root, name="program.elf")
        self.host.write = self._write
        self.host.read = self._read

    def _write(self, data: bytes) -> None:
        self.printed += data

    def _read(self, count: int) -> bytes | None:
        if self.waiting:
            return None
        data, self.typed = self.typed[:count], self.typed[count:]
        return data

    def __call__(self, operation: int, *words: int, at: int = BLOCK, now: int = 0) -> object:
        self.machine.poke(at, struct.pack(f"<{len(words)}I", *words))
        return self.host.call(operation, at, now)

    def put(self, text: bytes, at: int = TEXT) -> int:
        self.machine.poke(at, text)
        return at

    def open(self, name: str, mode: int = 0) -> object:
        data = name.encode()
        return self(0x01, self.put(data + b"\0", OTHER), mode, len(data))

    def memory(self, count: int, at: int = TEXT) -> bytes:
        return self.machine.peek(at, count)


@pytest.fixture
def caller() -> Iterator[Caller]:
    made = Caller()
    yield made
    made.host.close()


@pytest.fixture
def filer(tmp_path: Path) -> Iterator[Caller]:
    (tmp_path / "root").mkdir()
    (tmp_path / "secret.txt").write_text("secret")
    made = Caller(tmp_path / "root")
    yield made
    made.host.close()


def test_console_streams_are_opened_by_their_mode(caller: Caller) -> None:
    assert [caller.open(":tt", mode) for mode in range(12)] == [1] * 4 + [2] * 4 + [3] * 4
    assert caller.open(":tt", 12) == FAILED


def test_text_of_any_length_and_with_nuls_is_printed_whole(caller: Caller) -> None:
    text = bytes(97 + n % 26 for n in range(9000)) + b"Z"
    assert caller.host.call(0x04, caller.put(text + b"\0rest"), 0) == 0
    assert caller.printed == text
    assert caller(0x05, 2, caller.put(b"12\x0045\n"), 6) == 0
    assert caller.printed == text + b"12\x0045\n"
    assert caller.host.call(0x03, caller.put(b"xy"), 0) == 0
    assert caller.printed.endswith(b"\nx")


def test_write_beyond_the_memory_reports_what_was_not_written(caller: Caller) -> None:
    end = RAM_BASE + caller.machine.ram.size
    assert caller(0x05, 1, end - 3, 10) == 7
    assert caller(0x05, 2, 0x3000_0000, 3) == 3
    assert caller.printed == b"\0\0\0"
    caller.machine.poke(end - 2, b"ab")
    caller.host.call(0x04, end - 2, 0)  # has no end
    assert caller.printed == b"\0\0\0ab"


def test_console_input_is_read_by_block_and_by_character(caller: Caller) -> None:
    caller.typed = b"hi\n"
    assert caller.host.call(0x07, 0, 0) == ord("h")
    assert caller(0x06, 1, TEXT, 8) == 6
    assert caller.memory(2) == b"i\n"
    assert caller(0x06, 1, TEXT, 8) == 8  # the end of the input
    assert caller.host.call(0x07, 0, 0) == FAILED
    caller.waiting = True
    assert caller(0x06, 1, TEXT, 8) is None
    assert caller.host.call(0x07, 0, 0) is None


def test_features_can_be_read_and_not_written(caller: Caller) -> None:
    handle = caller.open(":semihosting-features")
    assert caller(0x0C, handle) == 5
    assert caller(0x06, handle, TEXT, 16) == 11
    assert caller.memory(5) == b"SHFB\x03"
    assert caller(0x0A, handle, 4) == 0
    assert caller(0x06, handle, TEXT, 1) == 0
    assert caller.memory(1) == b"\x03"
    assert caller(0x09, handle) == 0
    assert caller(0x02, handle) == 0
    assert caller(0x02, handle) == FAILED
    assert caller.open(":semihosting-features", 4) == FAILED


def test_clock_and_time_are_those_of_the_machine(caller: Caller) -> None:
    now = 5_000 * S + 1_234_567 * US
    assert caller.host.call(0x10, 0, now) == 500_123
    assert caller.host.call(0x11, 0, now) == 5_001
    assert caller.host.call(0x31, 0, now) == 1_000_000
    assert caller.host.call(0x30, TEXT, now) == 0
    assert int.from_bytes(caller.memory(8), "little") == 5_001_234_567


@pytest.mark.parametrize(
    ("operation", "parameter", "words", "status"),
    [
        (0x18, 0x20026, (), 0),
        (0x18, 0x20023, (), 1),
        (0x20, BLOCK, (0x20026, 42), 42),
        (0x20, BLOCK, (0x20023, 0), 1),
    ],
)
def test_exit_has_the_program_s_status(
    caller: Caller, operation: int, parameter: int, words: tuple[int, ...], status: int
) -> None:
    caller.put(struct.pack(f"<{len(words)}I", *words), BLOCK)
    assert caller.host.call(operation, parameter, 0) == Exit(status)


def test_other_operations_answer_as_documented(caller: Caller) -> None:
    assert [caller(0x08, value) for value in (0, 5, FAILED)] == [0, 0, 1]
    assert [caller(0x09, handle) for handle in (1, 2, 3, 99)] == [1, 1, 1, FAILED]
    assert caller(0x15, TEXT, 80) == 0
    assert caller.memory(12) == b"program.elf\0"
    assert caller.memory(8, BLOCK) == struct.pack("<2I", TEXT, 11)
    assert caller(0x15, TEXT, 11) == FAILED
    caller.put(b"\xff" * 16)
    assert caller(0x16, TEXT) == 0
    assert caller.memory(16) == bytes(16)
    assert caller(0x12, TEXT, 3) == FAILED  # SYS_SYSTEM
    assert caller.host.call(0x77, 0, 0) == FAILED
    assert caller.host.call(0x13, 0, 0) != 0


def test_all_files_are_refused_without_a_root(caller: Caller) -> None:
    assert caller.open("x.txt", 4) == FAILED
    assert caller(0x0E, caller.put(b"x.txt"), 5) == FAILED


@pytest.mark.parametrize(
    "name", ["../secret.txt", "/etc/passwd", ".", "", "link", "folder/../../secret.txt", "a\0b"]
)
def test_files_outside_the_root_are_refused(filer: Caller, tmp_path: Path, name: str) -> None:
    (tmp_path / "root" / "link").symlink_to(tmp_path / "secret.txt")
    (tmp_path / "root" / "folder").mkdir()
    for mode in (0, 4, 8):
        assert filer.open(name, mode) == FAILED
    assert filer(0x0E, filer.put(name.encode()), len(name)) == FAILED
    assert (tmp_path / "secret.txt").read_text() == "secret"


def test_files_in_the_root_are_written_read_and_removed(filer: Caller, tmp_path: Path) -> None:
    handle = filer.open("log.txt", 4)
    assert filer(0x05, handle, filer.put(b"one\0two"), 7) == 0
    assert filer(0x02, handle) == 0
    assert (tmp_path / "root" / "log.txt").read_bytes() == b"one\0two"
    handle = filer.open("log.txt", 1)
    assert (filer(0x0C, handle), filer(0x09, handle)) == (7, 0)
    assert (filer(0x0A, handle, 4), filer(0x0A, handle, 8)) == (0, FAILED)
    assert filer(0x06, handle, TEXT, 10) == 7
    assert filer.memory(3) == b"two"
    assert filer(0x06, handle, TEXT, 10) == 10
    assert filer(0x02, handle) == 0
    second = filer.put(b"new.txt", TEXT + 64)
    assert filer(0x0F, filer.put(b"log.txt"), 7, second, 7) == 0
    assert filer(0x0F, filer.put(b"new.txt"), 7, filer.put(b"../out", TEXT + 64), 6) == FAILED
    assert filer(0x0E, filer.put(b"new.txt"), 7) == 0
    assert list((tmp_path / "root").iterdir()) == []
    assert filer.open("new.txt", 0) == FAILED


def test_number_of_open_files_is_bounded(filer: Caller) -> None:
    handles = [filer.open("x", 4) for _ in range(70)]
    assert handles[:3] == [4, 5, 6]
    assert handles[-1] == FAILED
    filer.host.close()
    assert filer.open("x", 4) == 4


@pytest.fixture
def calling() -> Machine:
    """A machine whose program calls SYS_CLOCK and then counts in r2."""
    machine = Machine()
    image = bytes(Program("movs r0, #16; movs r2, #0; bkpt #0xAB; loop: adds r2, #1; b loop").image)
    machine.flash[: len(image)] = memoryview(image)
    machine.semihosting(True)
    machine.reset()
    list(machine.outbox())
    return machine


def test_call_stands_still_until_it_is_answered(calling: Machine) -> None:
    stop = calling.run(S)
    (call,) = calling.outbox()
    assert stop.sends
    assert (call.kind, call.unit, call.value) == (OutgoingKind.SEMIHOSTING, 0x10, 0)
    assert calling.run(2 * S).now_ps == stop.now_ps
    calling.answer_call(77)
    calling.run(stop.now_ps + 1000 * US)
    assert calling.register("r0") == 77
    assert calling.register("r2") > 100


def test_reset_ends_a_call(calling: Machine) -> None:
    calling.run(S)
    calling.reset()
    calling.semihosting(False)
    list(calling.outbox())
    assert calling.run(calling.now_ps + 1000 * US).now_ps > 163 * US


@pytest.mark.parametrize(("host", "debugger"), [(False, False), (True, False), (False, True)])
def test_program_sees_a_host_or_debugger_in_dhcsr(host: bool, debugger: bool) -> None:
    machine = Machine()
    machine.semihosting(host)
    machine.attach_debugger(debugger)
    value = machine.read(DHCSR)
    assert value is not None
    assert value & 1 == (host or debugger)
