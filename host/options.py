"""Options of experiments: each is declared once, as the field of a dataclass.

The command line is generated from these declarations, and programs give the same names as keywords.
"""

import math
import operator
from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any, Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Kind(Generic[T]):
    """A kind of value.

    Attributes:
        what: for error texts: "an angle in 0..180 degrees".
        read: makes one of a text or of a program's value; ValueError or TypeError when it is none.
        holds: whether it is in range.
    """

    what: str
    read: Callable[[Any], T]
    holds: Callable[[T], bool] = lambda _value: True

    def __call__(self, given: Any) -> T:
        """The value that ``given`` means; ValueError when it is not of this kind."""
        try:
            value = self.read(given)
        except (TypeError, ValueError):
            pass
        else:
            if self.holds(value):
                return value
        raise ValueError(f"{given!r} is not {self.what}")


def _whole(given: Any) -> int:
    return int(given) if isinstance(given, str) else operator.index(given)


def _corner(given: Any) -> tuple[int, int]:
    left, top = given.split(",") if isinstance(given, str) else given
    return _whole(left), _whole(top)


def whole(least: int, most: int | None = None) -> Kind[int]:
    wanted = f"of at least {least}" if most is None else f"in {least}..{most}"
    return Kind(
        f"a whole number {wanted}",
        _whole,
        lambda value: value >= least and (most is None or value <= most),
    )


def between(low: float, high: float, what: str) -> Kind[float]:
    """A number in ``low``..``high``; ``what`` says so to a reader."""
    return Kind(what, float, lambda value: low <= value <= high)


ANGLE = between(0, 180, "an angle in 0..180 degrees")
NUMBER = Kind("a number", float, math.isfinite)
YEAR = between(1800, 2200, "a year in 1800..2200")
"""Of proper motions: those of scenes."""

POSITIVE = Kind("a number above 0", float, lambda value: 0 < value < math.inf)
CORNER = Kind("X,Y, as in 0,256", _corner)
"""A pixel's column and row."""

PATH = Kind("a path", Path)
TEXT = Kind("a text", str)


def _file(given: Any) -> Any:
    return Path(given) if isinstance(given, str) else given


SCENE: Kind[Any] = Kind("a scene", _file)
"""The path of a scene file, or a scene that a program made."""

PLAN: Kind[Any] = Kind("a plan of faults", _file)
"""The path of a plan, or a plan that a program made."""


@dataclass(frozen=True)
class Option:
    """What is declared of an option, in the metadata of its field.

    Attributes:
        help: one phrase for a user.
        kind: of its value; None for a switch or a choice.
        metavar: what stands for the value in the help.
        choices: what it may be, as typed.
        many: it may be given several times; the value is a tuple.
        group: at most one option of a group can be given.
    """

    help: str
    kind: Kind[Any] | None = None
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    many: bool = False
    group: str | None = None

    def take(self, given: Any) -> Any:
        """The value that ``given`` means; ValueError when it can not be."""
        return tuple(map(self._one, given)) if self.many else self._one(given)

    def _one(self, given: Any) -> Any:
        if self.kind is not None:
            return self.kind(given)
        choices = self.choices or (False, True)
        if given not in choices:
            raise ValueError(f"{given!r} is none of {', '.join(map(str, choices))}")
        return given


def option(default: Any, text: str, kind: Kind[Any] | None = None, **more: Any) -> Any:
    """A field for an option; ``text`` is its help, ``more`` as ``Option`` has it."""
    return field(default=default, metadata={"option": Option(text, kind, **more)})


def flag(name: str) -> str:
    """An option's name as the command line has it."""
    return "--" + name.replace("_", "-")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Base of all options; each value is checked, and made of text where it is one.

    Raises ValueError for a value that can not be, and for options that do not go together.
    """

    def __post_init__(self) -> None:
        groups: dict[str, str] = {}
        for name, declared in self.declared().items():
            if not self.given(name):
                continue
            chosen: Option = declared.metadata["option"]
            try:
                object.__setattr__(self, name, chosen.take(getattr(self, name)))
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
            if (other := groups.setdefault(chosen.group or name, name)) != name:
                raise ValueError(f"{flag(other)} and {flag(name)} exclude each other")
        self.check()

    def check(self) -> None:
        """Refuse options that do not go together, with a ValueError."""

    def given(self, *names: str) -> bool:
        """Whether any of these options differs from its default."""
        return any(getattr(self, name) != self.declared()[name].default for name in names)

    @classmethod
    def declared(cls) -> dict[str, Field[Any]]:
        """The fields of the options by name."""
        return {one.name: one for one in fields(cls)}
