"""Commands of the shell, and messages and registers by name in any case, number or address.

A number (``128``, ``0x80``) is that of a message, ``@0x05`` the address of a register.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message, MessageKind
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.firmware_model.values import REQUIRED, number
from cubestack.host.targets import Target

GREATEST = 1e9
"""Of a number on a line."""


class ShellError(ValueError):
    """An invalid line; the text is one line and says what is valid."""


@dataclass
class CommandResult:
    """What a command found."""

    #: (name, value for a reader); a name may be empty
    rows: list[tuple[str, str]] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)  #: the same for a program, as JSON takes it


@dataclass(frozen=True)
class ShellCommand:
    """A shell command: usage, action, and what it needs."""

    usage: str
    meaning: str
    run: Callable[[list[str]], CommandResult]
    emulated_only: bool = False

    @property
    def name(self) -> str:
        return self.usage.split()[0]


def check_count(usage: str, words: Sequence[str], least: int, most: int) -> None:
    """Raise ShellError unless ``least`` to ``most`` words follow the command's name."""
    if not least <= len(words) <= most:
        raise ShellError(f"{usage.split()[0]}: {len(words)} words; usage: {usage}")


def to_number(command: str, text: str, least: float) -> float:
    """A number of at least ``least``; raises ShellError otherwise."""
    try:
        value: float = number(REQUIRED, "", least, GREATEST).parse(text)
    except ValueError as error:
        raise ShellError(f"{command}: {error}") from None
    return value


ADDRESS = "@"
NEAR = 3
"""Number of suggestions in an error."""

CUTOFF = 0.55
"""Least similarity of a suggested name."""

Found = Message | PointerRegister


def number_of(found: Found) -> str:
    return str(found.id) if isinstance(found, Message) else f"{ADDRESS}{found.address:#04x}"


@dataclass
class Names:
    """Messages and registers of one target; the caller closes it."""

    target: Target

    def of(self, command: str) -> list[str]:
        """All names that ``command`` (read, watch, write or list) accepts, in the tables' order."""
        return [found.name for found in self.all_of(command)]

    def all_of(self, command: str) -> list[Found]:
        interface = self.target.interface
        found: list[Found] = []
        if command != "write":
            found += [message for message in interface.telemetries if message.supported]
        if command in ("write", "list"):
            found += [message for message in interface.telecommands if message.supported]
        for register in self.registers:
            wanted = register.writable if command == "write" else register.readable
            found += [register] if wanted or command == "list" else []
        return found

    @property
    def registers(self) -> list[PointerRegister]:
        """Registers by address; empty if the target has no access to them."""
        registers = self.target.registers
        return [] if registers is None else list(registers.registers)

    def find(self, word: str, *kinds: MessageKind) -> Found | None:
        """The message of one of ``kinds``, or register, called ``word``; or None."""
        if word.startswith(ADDRESS):
            address = _integer(word.removeprefix(ADDRESS))
            return next((found for found in self.registers if found.address == address), None)
        number, name = _integer(word), word.lower()
        for message in self.target.interface.messages:
            if message.kind in kinds and (message.id == number or message.name.lower() == name):
                return message
        return next((found for found in self.registers if found.name.lower() == name), None)

    def need(self, command: str, word: str, *kinds: MessageKind) -> Found:
        """As ``find``, but raises ShellError with suggestions."""
        found = self.find(word, *kinds)
        if found is not None:
            return found
        if word.startswith(ADDRESS):
            raise ShellError(f"{command}: no register at {word!r}; {self._near_addresses(word)}")
        number = _integer(word)
        if number is not None:
            kind = " or ".join(kind.value for kind in kinds)
            near = self._near_numbers(number, *kinds)
            raise ShellError(f"{command}: no {kind} has number {word}; {near}")
        near = _near_names(word, self.of(command))
        raise ShellError(f"{command}: nothing is called {word!r}; {near}")

    def fields(self, word: str, kind: MessageKind) -> tuple[Field, ...]:
        """Fields of the message or register called ``word``; empty if there is none."""
        found = self.find(word, kind)
        if found is None:
            return ()
        return found.fields if isinstance(found, Message) else (found.field,)

    def _near_numbers(self, number: int, *kinds: MessageKind) -> str:
        known = [m for m in self.target.interface.messages if m.kind in kinds and m.supported]
        nearest = sorted(known, key=lambda message: abs(message.id - number))[:NEAR]
        return "near: " + ", ".join(f"{number_of(m)} ({m.name})" for m in nearest)

    def _near_addresses(self, word: str) -> str:
        address = _integer(word.removeprefix(ADDRESS))
        if not self.registers or address is None:
            return "registers are @ADDRESS, over I2C" if not self.registers else "as in @0x05"
        nearest = sorted(self.registers, key=lambda found: abs(found.address - address))[:NEAR]
        return "near: " + ", ".join(f"{number_of(r)} ({r.name})" for r in nearest)


def _near_names(word: str, known: list[str]) -> str:
    lower = {name.lower(): name for name in known}
    close = get_close_matches(word.lower(), lower, n=NEAR, cutoff=CUTOFF)
    close += [name for name in lower if word.lower() in name and name not in close]
    if not close:
        return "`list` lists all names"
    *others, last = [lower[name] for name in close[:NEAR]]
    return f"did you mean {', '.join(others)}{' or ' if others else ''}{last}?"


def _integer(word: str) -> int | None:
    try:
        return int(word, 0)
    except ValueError:
        return None
