"""What the shell's commands share: results, descriptions and errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from cubestack.firmware_model.values import REQUIRED, number

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
