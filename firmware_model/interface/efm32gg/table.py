"""Register tables: a peripheral is declared in lines of text.

A line is ``offset NAME access reset field ...``; addresses and values are hexadecimal, counts
decimal::

    000 CTRL    rw 0000000C  MODE:0:2 BOOST:2:2 EN:4
    004 STATUS  r  00000000  BUSY:0
    008 CMD     w  00000000  START:0 STOP:1
    010 DATA    rw 00000000  *

- ``rw``, ``r`` or ``w``; a field with another access states it: ``EN:4:1:r``. A ``r`` with a side
  effect (reading takes the data) is ``ra``.
- ``NAME:lsb:width``; a width of 1 may be omitted. ``*`` is the whole register.
- ``CH{0-11}:0`` is twelve adjacent fields. In a register's name, with ``offset/step``, it is
  several registers: ``030/10 CC{0-2}_CTRL``; ``{ABC}`` are letters.
- A line that begins with ``+`` continues the fields of the previous one.
- ``- note`` at the end of a line: the emulator stores the value but does not use it.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field


class RegisterTableError(ValueError):
    """A line of a table is malformed or contradicts another."""


@dataclass(frozen=True)
class RegisterField:
    """Adjacent bits of a register."""

    name: str
    lsb: int
    width: int
    readable: bool
    writable: bool
    values: tuple[tuple[int, str], ...] = ()  #: the named ones

    @property
    def mask(self) -> int:
        return ((1 << self.width) - 1) << self.lsb


@dataclass(frozen=True)
class Register:
    """One word; ``modelled`` is False if the emulator only stores the value."""

    offset: int
    name: str
    reset: int
    fields: tuple[RegisterField, ...]
    action: bool = False
    modelled: bool = True

    @property
    def readable(self) -> int:
        """Bits that can read as 1."""
        return sum(field.mask for field in self.fields if field.readable)

    @property
    def writable(self) -> int:
        return sum(field.mask for field in self.fields if field.writable)


@dataclass(frozen=True)
class Instance:
    """One peripheral of the part: its address, and its interrupt numbers by name."""

    name: str
    base: int
    interrupts: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Layout:
    """Registers of a kind of peripheral."""

    name: str  #: of the kind; the same as the instance's if there is only one
    title: str  #: description and chapter of the reference manual
    registers: tuple[Register, ...]  #: in the order of their offsets
    instances: tuple[Instance, ...]  #: peripherals of the part

    @property
    def size(self) -> int:
        """Bytes up to the end of the last register."""
        return max(register.offset for register in self.registers) + 4

    def __getitem__(self, name: str) -> Register:
        for register in self.registers:
            if register.name == name:
                return register
        raise KeyError(f"{self.name} has no register {name!r}")


@dataclass(frozen=True)
class Core:
    """A processor core, in the words of CMSIS-SVD's element "cpu"."""

    name: str = "CM3"
    revision: str = "r2p1"
    has_mpu: bool = True
    priority_bits: int = 3  #: implemented bits of an interrupt's priority


@dataclass(frozen=True)
class Processor:
    """A processor on its board, as firmware sees it."""

    name: str  #: of the part
    layouts: Sequence[Layout]  #: its registers
    pins_header: Callable[[], str]  #: writes the C header of its connections on the board
    core: Core = Core()  #: EFM32GG Reference Manual, chapter 4


def peripheral(name: str, title: str, registers: str, *instances: Instance) -> Layout:
    """The layout declared by ``registers``; RegisterTableError names a wrong line."""
    found: dict[int, Register] = {}
    names: set[str] = set()
    for line in re.sub(r"\n\s*\+", "", registers).splitlines():
        for register in _registers(name, line):
            if register.offset in found or register.name in names:
                raise RegisterTableError(f"{name}: declared twice: {line.strip()!r}")
            found[register.offset] = register
            names.add(register.name)
    return Layout(name, title, tuple(found[at] for at in sorted(found)), instances)


def _registers(layout: str, line: str) -> Iterator[Register]:
    text, dash, _note = line.partition(" - ")
    words = text.split()
    if not words:
        return
    if len(words) < 5:
        raise RegisterTableError(f"{layout}: no 'offset NAME access reset field': {line.strip()!r}")
    where, name, access, reset, *fields = words
    offset, _, step = where.partition("/")
    try:
        for index, one in enumerate(_names(name)):
            at = int(offset, 16) + index * int(step or "0", 16)
            bits = tuple(field for word in fields for field in _fields(word, access))
            register = Register(at, one, int(reset, 16), bits, "a" in access, not dash)
            _check(register)
            yield register
    except ValueError as error:
        raise RegisterTableError(f"{layout}: {error}: {line.strip()!r}") from None


def _fields(word: str, access: str) -> Iterator[RegisterField]:
    if word == "*":
        yield RegisterField("", 0, 32, "r" in access, "w" in access)
        return
    name, lsb, *rest = word.split(":")
    width = int(rest[0]) if rest and rest[0] else 1
    own = rest[1] if len(rest) > 1 else access
    for index, one in enumerate(_names(name)):
        yield RegisterField(one, int(lsb) + index * width, width, "r" in own, "w" in own)


def _names(name: str) -> Iterator[str]:
    """``CH{0-2}X`` is CH0X, CH1X, CH2X; ``P{AC}`` is PA, PC."""
    match = re.fullmatch(r"(\w*)\{(\w+)(?:-(\w+))?\}(\w*)", name)
    if not match:
        if not name.isidentifier():
            raise ValueError(f"{name!r} is no name")
        yield name
        return
    before, first, last, after = match.groups()
    parts = map(str, range(int(first), int(last) + 1)) if last else first
    for part in parts:
        yield before + part + after


def _check(register: Register) -> None:
    taken = 0
    if register.offset % 4:
        raise ValueError(f"{register.offset:#x} is no word's offset")
    for bits in register.fields:
        if bits.lsb + bits.width > 32 or bits.mask & taken:
            raise ValueError(f"bits of {bits.name} are another's, or not there")
        taken |= bits.mask
    if register.reset & ~taken:
        raise ValueError(f"reset value {register.reset:#x} has bits that no field has")
