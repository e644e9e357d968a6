"""The declaration of one value, and constructors for the usual types."""

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from functools import partial
from numbers import Real
from typing import Any

REQUIRED: Any = object()
"""Default of a value that must be given."""

UNITS = {
    "_deg_s": "deg/s",
    "_km_s": "km/s",
    "_deg": "deg",
    "_rad": "rad",
    "_arcsec": "arcsec",
    "_km": "km",
    "_mm": "mm",
    "_um": "um",
    "_px": "px",
    "_c": "C",
    "_ma": "mA",
    "_ms": "ms",
    "_us": "us",
    "_ns": "ns",
    "_mag": "mag",
    "_m": "m",
    "_s": "s",
}
"""Unit of a value whose declaration has none, by the end of its name; the first match counts."""


@dataclass(frozen=True)
class ValueKind:
    """A type of values.

    Attributes:
        name: in JSON.
        what: for error texts: "a number".
        read: converts what TOML, JSON or a program gave; raises one of ``_OTHER`` for another type.
        parse: converts a text for ``read``; raises the same.
    """

    name: str
    what: str
    read: Callable[[Any], Any]
    parse: Callable[[str], Any]


_OTHER = (ArithmeticError, LookupError, TypeError, ValueError)
"""What reading a value of another type raises."""


def _number(given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, Real) or not math.isfinite(given):
        raise TypeError
    return float(given)


def _whole(given: Any) -> int:
    if isinstance(given, bool):
        raise TypeError
    return operator.index(given)


def _integer(given: str) -> int:
    try:
        return int(given)
    except ValueError:
        return int(given, 0)  # 0x10


def _exactly(kind: type[Any]) -> Callable[[Any], Any]:
    def read(given: Any) -> Any:
        if not isinstance(given, kind):
            raise TypeError
        return given

    return read


NUMBER = ValueKind("number", "a number", _number, float)
WHOLE = ValueKind("whole", "a whole number", _whole, _integer)
FLAG = ValueKind(
    "flag",
    "true or false",
    _exactly(bool),
    lambda given: {"true": True, "false": False}[given.lower()],
)
TEXT = ValueKind("text", "text", _exactly(str), str)
CHOICE = ValueKind("choice", "a name", _exactly(str), str)
TABLE = ValueKind("table", "a table", _exactly(dict), str)
MOMENT = ValueKind(
    "moment", "a date and time, as 2013-06-01T20:00:00Z", _exactly(datetime), datetime.fromisoformat
)


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """What a named value is, and what it may be.

    Attributes:
        name: where it is listed; empty until it is part of a list.
        meaning: one phrase for a reader.
        unit: of a number, empty for none.
        low, high: its limits, both allowed; infinite for none.
        choices: the allowed names, in order; of a mapping or an enumeration, also what each means
            to a program. Empty for any value of the kind.
        default: `REQUIRED` where there is none; with None, None is allowed.
        kind: its type.
        make: what becomes of a value that is read; ValueError for one that is not allowed.
        exclusive: whether ``low`` itself is not allowed.
        formerly: a name that is deprecated, empty for none.
        instead: names of values that are given instead of this one, or this one instead of them.
        role: "ra", "dec" or "roll" of a camera, or the "direction" of something; else empty.
        metavar: stands for the value in the help of a command.
        group: of the values of one group, at most one can be given.
    """

    name: str = ""
    meaning: str = ""
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: Any = ()
    default: Any = REQUIRED
    kind: ValueKind = TEXT
    make: Callable[[Any], Any] | None = None
    exclusive: bool = False
    formerly: str = ""
    instead: tuple[str, ...] = ()
    role: str = ""
    metavar: str = ""
    group: str = ""

    @property
    def choice_values(self) -> Mapping[str, Any]:
        """What each of the choices means to a program, by its name."""
        if isinstance(self.choices, Mapping):
            return self.choices
        if isinstance(self.choices, type):
            return self.choices.__members__  # type: ignore[attr-defined,no-any-return]
        return {one: one for one in self.choices}

    @property
    def limits(self) -> str:
        """The limits in words, with the unit; empty for a number without any."""
        low, high = f"{self.low:.10g}", f"{self.high:.10g}"
        least = f"above {low}" if self.exclusive else f"at least {low}"
        match math.isfinite(self.low), math.isfinite(self.high):
            case True, True:
                text = f"{least} and at most {high}" if self.exclusive else f"{low} to {high}"
            case True, False:
                text = least
            case False, True:
                text = f"at most {high}"
            case _:
                return ""
        return f"{text} {self.unit}".rstrip()

    @property
    def wanted(self) -> str:
        """What it must be apart from its limits, in words."""
        return f"one of {', '.join(self.choice_values)}" if self.choices else self.kind.what

    @property
    def allowed(self) -> str:
        """What is allowed, in words, as documents list it."""
        return self.limits or " or ".join(self.choice_values) or self.kind.what

    def fits(self, value: Any) -> bool:
        """Whether a number is within the limits; anything is where there are none."""
        if self.low == -math.inf and self.high == math.inf:
            return True
        if self.exclusive and value == self.low:
            return False
        return bool(self.low <= value <= self.high)

    def read(self, given: Any) -> Any:
        """The value that TOML, JSON or a program gave; ValueError says what it must be."""
        try:
            if self.choices:
                return self.choice_values[given]
            value = self.kind.read(given)
        except _OTHER:
            raise self.error(given) from None
        if not self.fits(value):
            raise self.error(given, self.limits)
        return value if self.make is None else self.make(value)

    def parse(self, given: str) -> Any:
        """The value of a text, as on a command line; ValueError says what it must be."""
        try:
            parsed = given if self.choices else self.kind.parse(given)
        except _OTHER:
            raise self.error(given) from None
        return self.read(parsed)

    def take(self, given: Any) -> Any:
        """The value of a text, or of what a program gave."""
        return self.parse(given) if isinstance(given, str) else self.read(given)

    def check(self, value: Any) -> None:
        """Raise ValueError for a value of a program that is not allowed."""
        if value is None and self.default is None:
            return
        if not self.choices:
            self.read(value)
        elif value not in self.choice_values.values():
            raise self.error(value)

    def error(self, given: Any, wanted: str = "") -> ValueError:
        """The error for a value that is not allowed; whoever catches it puts the name in front."""
        shown = repr(given) if isinstance(given, str) else given
        return ValueError(f"must be {wanted or self.wanted}, not {shown}")

    def described(self) -> dict[str, Any]:
        """As JSON has it: ``type``, ``unit``, ``default`` and ``meaning``, and what else there is.

        A default that JSON does not have is None, like no default.
        """
        default = next(
            (name for name, value in self.choice_values.items() if value == self.default),
            plain(self.default),
        )
        found = {"type": self.kind.name, "unit": self.unit, "default": default}
        limits = {"low": self.low, "high": self.high}
        found |= {end: limit for end, limit in limits.items() if math.isfinite(limit)}
        found |= {"meaning": self.meaning, "choices": [*self.choice_values]}
        found |= {"instead": [*self.instead], "role": self.role}
        always = ("type", "unit", "default", "low", "high", "meaning")
        return {key: one for key, one in found.items() if one or key in always}


@dataclass(frozen=True, kw_only=True)
class ListDeclaration(Declaration):
    """A list of values.

    Attributes:
        part: what each of them is.
        count: of them; None for any number.
    """

    part: Declaration
    count: int | None = None

    @property
    def wanted(self) -> str:
        """What it must be, in words."""
        what = "texts" if self.part.kind is TEXT else "numbers"
        return "a list" if self.count is None else f"a list of {self.count} {what}"

    def read(self, given: Any) -> Any:
        parts = given.tolist() if hasattr(given, "tolist") else given  # an array
        if not isinstance(parts, list | tuple) or self.count not in (None, len(parts)):
            raise self.error(given)
        values = tuple(self.part.read(one) for one in parts)
        return values if self.make is None else self.make(values)

    def take(self, given: Any) -> tuple[Any, ...]:
        """The values, each a text or what a program gave."""
        return tuple(self.part.take(one) for one in given)

    def described(self) -> dict[str, Any]:
        """As JSON has it, with ``count`` and what each is ``of``."""
        part = self.part.described()
        of = {key: one for key, one in part.items() if key not in ("unit", "default") and one != ""}
        return {**super().described(), "type": "list", "count": self.count, "of": of}


def plain(value: Any) -> Any:
    """``value`` as TOML and JSON have it: numbers, texts, lists; None where it has no such form."""
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, tuple | list):
        parts = [plain(one) for one in value]
        return None if None in parts else parts
    return value if isinstance(value, bool | int | float | str) else None


def declare(
    kind: ValueKind,
    default: Any,
    meaning: str,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    **more: Any,
) -> Any:
    """A value of a kind; ``more`` are keywords of `Declaration`."""
    return Declaration(
        kind=kind, default=default, meaning=meaning, low=low, high=high, unit=unit, **more
    )


# Each takes (default, meaning), then (low, high, unit) for numbers, then keywords of `Declaration`.
number: Callable[..., Any] = partial(declare, NUMBER)
whole: Callable[..., Any] = partial(declare, WHOLE)
flag: Callable[..., Any] = partial(declare, FLAG)
text: Callable[..., Any] = partial(declare, TEXT)
moment: Callable[..., Any] = partial(declare, MOMENT)
positive: Callable[..., Any] = partial(declare, NUMBER, low=0, exclusive=True)


def choice(default: Any, meaning: str, choices: Any, **more: Any) -> Any:
    """One of some names: a sequence, or a mapping or enumeration of what each means."""
    return Declaration(default=default, meaning=meaning, choices=choices, kind=CHOICE, **more)


def vector(
    count: int,
    default: Any,
    meaning: str,
    *limits: Any,
    kind: Callable[..., Any] = number,
    **more: Any,
) -> Any:
    """A list of so many numbers, each with ``limits`` as `number` takes them."""
    part = kind(REQUIRED, "", *limits)
    return ListDeclaration(default=default, meaning=meaning, part=part, count=count, **more)


def many(default: Any, meaning: str, part: Declaration, **more: Any) -> Any:
    """A list of any number of values."""
    return ListDeclaration(default=default, meaning=meaning, part=part, **more)
