"""The host of semihosting calls: console, files, clock, exit.

"Semihosting for AArch32 and AArch64", Arm 100863, release 2024Q4: operations (chapter 6) and their
parameter blocks, errors, ``:semihosting-features`` (5.5). A program calls by BKPT 0xAB with the
operation in r0 and a word or the address of a block in r1; the answer is in r0.

Clock and time are those of the machine, since power-up, so runs repeat exactly. The heap is
reported as four zeros: the program uses the values of its linker script, as on a board.
"""

import errno
import os
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from enum import IntEnum
from io import FileIO
from pathlib import Path

from cubestack.emulator.iss.machine import Machine

FAILED = 0xFFFF_FFFF
APPLICATION_EXIT = 0x20026
CONSOLE, FEATURES = ":tt", ":semihosting-features"
FEATURE_BYTES = b"SHFB" + bytes([0b11])
"""Magic number and features: SYS_EXIT_EXTENDED; stdout and stderr are separate."""

STDIN, STDOUT, STDERR, FIRST_FILE = 1, 2, 3, 4
MODES = ("rb", "rb", "r+b", "r+b", "wb", "wb", "w+b", "w+b", "ab", "ab", "a+b", "a+b")
"""Of SYS_OPEN, with ISO C's meaning; text files are not translated."""

TICKS_PER_S = 1_000_000
PS_PER_TICK, PS_PER_CS, PS_PER_S = 10**6, 10**10, 10**12
CHUNK = 1024
MOST_OPEN = 64
MOST_BYTES = 1 << 20
"""Of one read or write: the largest memory. The rest counts as not transferred."""


class Operation(IntEnum):
    """Numbers of the operations."""

    OPEN = 0x01
    CLOSE = 0x02
    WRITEC = 0x03
    WRITE0 = 0x04
    WRITE = 0x05
    READ = 0x06
    READC = 0x07
    ISERROR = 0x08
    ISTTY = 0x09
    SEEK = 0x0A
    FLEN = 0x0C
    TMPNAM = 0x0D
    REMOVE = 0x0E
    RENAME = 0x0F
    CLOCK = 0x10
    TIME = 0x11
    SYSTEM = 0x12
    ERRNO = 0x13
    GET_CMDLINE = 0x15
    HEAPINFO = 0x16
    EXIT = 0x18
    EXIT_EXTENDED = 0x20
    ELAPSED = 0x30
    TICKFREQ = 0x31


@dataclass(frozen=True)
class Exit:
    """The program ended."""

    status: int  #: as it gave it, 0 is success


@dataclass(eq=False)
class SemihostingHost:
    """Answers the calls of one machine's program.

    Attributes:
        root: folder whose files the program may use; None refuses all files.
        write: receives the program's output.
        read: returns up to that many bytes of input, b"" at its end, None while there is none yet.
        name: the program's, for SYS_GET_CMDLINE.
    """

    machine: Machine
    _: KW_ONLY
    root: Path | None = None
    write: Callable[[bytes], None] = lambda _data: None
    read: Callable[[int], bytes | None] = lambda _count: b""
    name: str = ""
    _files: dict[int, FileIO | bytes] = field(default_factory=dict)
    _positions: dict[int, int] = field(default_factory=dict)
    _errno: int = 0
    _now_ps: int = 0

    def call(self, operation: int, parameter: int, now_ps: int) -> int | Exit | None:
        """Result of a call at the machine's time; None while it waits for input."""
        try:
            act = _ACTS.get(Operation(operation))
        except ValueError:
            act = None
        if act is None:
            return self._fail(errno.ENOSYS)
        self._now_ps = now_ps
        try:
            return act(self, parameter)
        except OSError as error:
            return self._fail(error.errno or errno.EIO)

    def close(self) -> None:
        """Close the program's files."""
        for one in self._files.values():
            if not isinstance(one, bytes):
                one.close()
        self._files.clear()

    # --- memory of the program ------------------------------------------------------------------

    def _words(self, address: int, count: int) -> list[int]:
        data = self.machine.peek(address, 4 * count).ljust(4 * count, b"\0")
        return [int.from_bytes(data[at : at + 4], "little") for at in range(0, 4 * count, 4)]

    def _put_words(self, address: int, *words: int) -> None:
        for index, word in enumerate(words):
            self.machine.poke(address + 4 * index, (word & FAILED).to_bytes(4, "little"))

    def _name(self, address: int, length: int) -> str:
        if length > CHUNK:
            raise OSError(errno.ENAMETOOLONG, "")
        return os.fsdecode(self.machine.peek(address, length))

    def _path(self, name: str) -> Path:
        """A file below ``root``; OSError for any other."""
        if self.root is None or "\0" in name:
            raise OSError(errno.EACCES, "")
        root = self.root.resolve()
        path = (root / name).resolve()
        if path == root or not path.is_relative_to(root):
            raise OSError(errno.EACCES, "")
        return path

    def _fail(self, number: int) -> int:
        self._errno = number
        return FAILED

    # --- files ----------------------------------------------------------------------------------

    def _open(self, block: int) -> int:
        address, mode, length = self._words(block, 3)
        name = self._name(address, length)
        if mode >= len(MODES):
            return self._fail(errno.EINVAL)
        if name == CONSOLE:
            return (STDIN, STDOUT, STDERR)[mode // 4]
        if len(self._files) >= MOST_OPEN:
            return self._fail(errno.EMFILE)
        found: FileIO | bytes
        if name == FEATURES:
            if mode > 1:
                return self._fail(errno.EACCES)
            found = FEATURE_BYTES
        else:
            path = self._path(name)
            if path.exists() and not path.is_file():  # reading a pipe would never return
                return self._fail(errno.EACCES)
            found = FileIO(path, MODES[mode])
        handle = next(n for n in range(FIRST_FILE, FIRST_FILE + MOST_OPEN) if n not in self._files)
        self._files[handle] = found
        self._positions[handle] = 0
        return handle

    def _is_console(self, handle: int) -> bool:
        """Whether it is a stream of the console, which needs no opening; OSError if it is none."""
        if handle in (STDIN, STDOUT, STDERR):
            return True
        if handle not in self._files:
            raise OSError(errno.EBADF, "")
        return False

    def _close(self, block: int) -> int:
        (handle,) = self._words(block, 1)
        if not self._is_console(handle):
            one = self._files.pop(handle)
            if not isinstance(one, bytes):
                one.close()
        return 0

    def _write_block(self, block: int) -> int:
        handle, address, length = self._words(block, 3)
        console = self._is_console(handle)
        data = self.machine.peek(address, min(length, MOST_BYTES))
        if console:
            self.write(data)
            return length - len(data)
        one = self._files[handle]
        if isinstance(one, bytes):
            self._errno = errno.EBADF
            return length
        return length - one.write(data)

    def _read_block(self, block: int) -> int | None:
        handle, address, length = self._words(block, 3)
        most = min(length, MOST_BYTES)
        if self._is_console(handle):
            data = self.read(most) if most else b""
            if data is None:
                return None
        else:
            one = self._files[handle]
            if isinstance(one, bytes):
                at = self._positions[handle]
                data = one[at : at + most]
                self._positions[handle] += len(data)
            else:
                data = one.read(most)
        return length - self.machine.poke(address, data) if data else length

    def _is_tty(self, block: int) -> int:
        return int(self._is_console(self._words(block, 1)[0]))

    def _seek(self, block: int) -> int:
        handle, position = self._words(block, 2)
        if self._is_console(handle):
            return self._fail(errno.ESPIPE)
        if position > self._length(handle):  # undefined by the document
            return self._fail(errno.EINVAL)
        one = self._files[handle]
        if isinstance(one, bytes):
            self._positions[handle] = position
        else:
            one.seek(position)
        return 0

    def _length(self, handle: int) -> int:
        one = self._files[handle]
        if isinstance(one, bytes):
            return len(one)
        return os.fstat(one.fileno()).st_size

    def _file_length(self, block: int) -> int:
        (handle,) = self._words(block, 1)
        return 0 if self._is_console(handle) else self._length(handle)

    def _temporary_name(self, block: int) -> int:
        address, number, size = self._words(block, 3)
        name = f"tmp{number & 0xFF:03}".encode() + b"\0"
        if size < len(name):
            return self._fail(errno.EINVAL)
        self.machine.poke(address, name)
        return 0

    def _remove(self, block: int) -> int:
        self._path(self._name(*self._words(block, 2))).unlink()
        return 0

    def _rename(self, block: int) -> int:
        first, first_length, second, second_length = self._words(block, 4)
        target = self._path(self._name(second, second_length))
        self._path(self._name(first, first_length)).rename(target)
        return 0

    # --- console --------------------------------------------------------------------------------

    def _write_character(self, address: int) -> int:
        self.write(self.machine.peek(address, 1))
        return 0

    def _write_text(self, address: int) -> int:
        text = bytearray()
        while len(text) < MOST_BYTES:
            part = self.machine.peek(address + len(text), CHUNK)
            end = part.find(0)
            text += part if end < 0 else part[:end]
            if end >= 0 or len(part) < CHUNK:
                break
        self.write(bytes(text))
        return 0

    def _read_character(self, _parameter: int) -> int | None:
        data = self.read(1)
        return None if data is None else data[0] if data else FAILED

    # --- others ---------------------------------------------------------------------------------

    def _clock(self, _parameter: int) -> int:
        return self._now_ps // PS_PER_CS

    def _time(self, _parameter: int) -> int:
        return self._now_ps // PS_PER_S

    def _elapsed(self, block: int) -> int:
        ticks = self._now_ps // PS_PER_TICK
        self._put_words(block, ticks, ticks >> 32)
        return 0

    def _command_line(self, block: int) -> int:
        address, size = self._words(block, 2)
        line = self.name.encode()
        if size <= len(line):
            return self._fail(errno.E2BIG)
        self.machine.poke(address, line + b"\0")
        self._put_words(block + 4, len(line))
        return 0

    def _heap(self, block: int) -> int:
        self._put_words(self._words(block, 1)[0], 0, 0, 0, 0)
        return 0

    def _exit(self, reason: int) -> Exit:
        return Exit(0 if reason == APPLICATION_EXIT else 1)

    def _exit_extended(self, block: int) -> Exit:
        reason, status = self._words(block, 2)
        return Exit(status if reason == APPLICATION_EXIT else 1)


_ACTS: dict[Operation, Callable[[SemihostingHost, int], int | Exit | None]] = {
    Operation.OPEN: SemihostingHost._open,
    Operation.CLOSE: SemihostingHost._close,
    Operation.WRITEC: SemihostingHost._write_character,
    Operation.WRITE0: SemihostingHost._write_text,
    Operation.WRITE: SemihostingHost._write_block,
    Operation.READ: SemihostingHost._read_block,
    Operation.READC: SemihostingHost._read_character,
    Operation.ISERROR: lambda host, block: int(host._words(block, 1)[0] >> 31),
    Operation.ISTTY: SemihostingHost._is_tty,
    Operation.SEEK: SemihostingHost._seek,
    Operation.FLEN: SemihostingHost._file_length,
    Operation.TMPNAM: SemihostingHost._temporary_name,
    Operation.REMOVE: SemihostingHost._remove,
    Operation.RENAME: SemihostingHost._rename,
    Operation.CLOCK: SemihostingHost._clock,
    Operation.TIME: SemihostingHost._time,
    Operation.SYSTEM: lambda host, _block: host._fail(errno.EPERM),
    Operation.ERRNO: lambda host, _block: host._errno,
    Operation.GET_CMDLINE: SemihostingHost._command_line,
    Operation.HEAPINFO: SemihostingHost._heap,
    Operation.EXIT: SemihostingHost._exit,
    Operation.EXIT_EXTENDED: SemihostingHost._exit_extended,
    Operation.ELAPSED: SemihostingHost._elapsed,
    Operation.TICKFREQ: lambda _host, _block: TICKS_PER_S,
}
