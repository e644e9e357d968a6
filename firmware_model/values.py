"""Declared values: name, type, unit, limits, default, choices and meaning, in one form everywhere.

Message fields, keys of scene files, hazards, faults, options and settings are declared with it.
Checks, error texts, help, forms and documents derive from the declaration.
"""

import math
import operator
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import Enum
from functools import partial
from numbers import Real
from typing import Any, ClassVar

REQUIRED: Any = object()
"""Default of a value that must be given."""


LARGEST_WHOLE = 2**63 - 1
LONGEST_SHOWN = 60
"""Characters of a wrong value in an error."""

_OTHER = (ArithmeticError, LookupError, TypeError, ValueError)
"""What reading a value of another type raises."""

_UNITS = ("deg", "rad", "arcsec", "km", "mm", "um", "px", "ms", "us", "ns", "mag", "m", "s")


@dataclass(frozen=True)
class ValueKind:
    """A type of values."""

    name: str  #: in JSON
    what: str  #: for error texts: "a number"
    #: converts what TOML, JSON or a program gave; raises one of ``_OTHER`` for another type
    read: Callable[[Any], Any]
    parse: Callable[[str], Any]  #: converts a text for ``read``; raises the same


LARGEST_NUMBER = 1e18
"""Of a number without limits of its own: its square and a product of some are still finite."""


def _number(given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, Real) or math.isnan(given):
        raise TypeError
    if not abs(found := float(given)) <= LARGEST_NUMBER:
        raise TypeError
    return found


def _whole(given: Any) -> int:
    if isinstance(given, bool) or abs(found := operator.index(given)) >> 64:
        raise TypeError
    return found


def _integer(given: str) -> int:
    try:
        return int(given)
    except ValueError:
        return int(given, 0)  # 0x10


def _flag(given: str) -> bool:
    return {"true": True, "false": False}[given.lower()]


def _seconds(given: str) -> float:
    number = given.rstrip("smu ")
    return float(number) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "": 1.0}[given[len(number) :].strip()]


def _kind(name: str, what: str, own: type[Any], parse: Callable[[str], Any]) -> ValueKind:
    def read(given: Any) -> Any:
        if not isinstance(given, own):
            raise TypeError
        return given

    return ValueKind(name, what, read, parse)


NUMBER = ValueKind("number", "a number", _number, float)
DURATION = ValueKind("number", "a time such as 5s or 200ms", _number, _seconds)
WHOLE = ValueKind("whole", "a whole number", _whole, _integer)
FLAG = _kind("flag", "true or false", bool, _flag)
TEXT = _kind("text", "text", str, str)
CHOICE = _kind("choice", "a name", str, str)
TABLE = _kind("table", "a table", dict, str)
MOMENT = _kind(
    "moment", "a date and time, as 2013-06-01T20:00:00Z", datetime, datetime.fromisoformat
)


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """What a named value is, and what it may be.

    Attributes:
        name: where it is listed; empty until it is part of a list.
        meaning: one phrase for a reader.
        unit: of a number, empty for none.
        low, high: its limits, both allowed; infinite for none.
        choices: the allowed names; of a mapping or an enumeration, also what each means to a
            program. Empty for any value of the kind.
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
        if isinstance(self.choices, type):
            return self.choices.__members__  # type: ignore[attr-defined,no-any-return]
        return self.choices if isinstance(self.choices, Mapping) else {c: c for c in self.choices}

    @property
    def limits(self) -> str:
        """The limits in words, with the unit; empty for a value without any."""
        low, high = f"{self.low:.10g}", f"{self.high:.10g}"
        text = f"above {low}" if self.exclusive else f"at least {low}"
        if math.isfinite(self.high):
            text = f"{text} and at most {high}" if self.exclusive else f"{low} to {high}"
            text = text if math.isfinite(self.low) else f"at most {high}"
        elif math.isinf(self.low):
            return ""
        return f"{text} {self.unit}".rstrip()

    @property
    def wanted(self) -> str:
        """What it must be apart from its limits, in words."""
        return f"one of {', '.join(self.choice_values)}" if self.choices else self.kind.what

    def fits(self, value: Any) -> bool:
        """Whether a number is within the limits; anything is where there are none."""
        if self.low == -math.inf and self.high == math.inf:
            return True
        return bool(self.low <= value <= self.high) and not (self.exclusive and value == self.low)

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
        if self.kind is WHOLE and abs(value) > LARGEST_WHOLE:
            raise self.error(given, f"{self.wanted} of 64 bits")
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
        shown = repr(given) if isinstance(given, str) else str(given)
        if len(shown) > LONGEST_SHOWN:
            shown = f"{shown[:LONGEST_SHOWN]}… ({len(shown)} characters)"
        return ValueError(f"must be {wanted or self.wanted}, not {shown}")

    def described(self) -> dict[str, Any]:
        """As JSON has it: ``type``, ``unit``, ``default`` and ``meaning``, and what else there is.

        A default that JSON does not have is None, like no default.
        """
        names = [name for name, value in self.choice_values.items() if value == self.default]
        default = names[0] if names else plain(self.default)
        found = {"type": self.kind.name, "unit": self.unit, "default": default}
        ends = {"low": self.low, "high": self.high}
        found |= {end: limit for end, limit in ends.items() if math.isfinite(limit)}
        found["meaning"] = self.meaning
        more = {"choices": [*self.choice_values], "instead": [*self.instead], "role": self.role}
        return found | {key: one for key, one in more.items() if one}


@dataclass(frozen=True, kw_only=True)
class ListDeclaration(Declaration):
    """A list of ``count`` values, None for any number, each as ``part``."""

    part: Declaration
    count: int | None = None

    @property
    def wanted(self) -> str:
        what = "texts" if self.part.kind is TEXT else "numbers"
        return "a list" if self.count is None else f"a list of {self.count} {what}"

    def read(self, given: Any) -> Any:
        parts = given.tolist() if hasattr(given, "tolist") else given  # an array
        return self._made(parts, parts, self.part.read)

    def parse(self, given: str) -> Any:
        """The values of a text with commas between them."""
        return self._made(given, given.split(","), self.part.parse)

    def take(self, given: Any) -> Any:
        return (
            self.parse(given)
            if isinstance(given, str)
            else self._made(given, given, self.part.take)
        )

    def _made(self, given: Any, parts: Any, read: Callable[[Any], Any]) -> Any:
        if not isinstance(parts, list | tuple) or self.count not in (None, len(parts)):
            raise self.error(given)
        values = tuple(read(one) for one in parts)
        return values if self.make is None else self.make(values)

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
duration: Callable[..., Any] = partial(declare, DURATION, low=0, unit="s", exclusive=True)
whole: Callable[..., Any] = partial(declare, WHOLE)
flag: Callable[..., Any] = partial(declare, FLAG)
text: Callable[..., Any] = partial(declare, TEXT)
moment: Callable[..., Any] = partial(declare, MOMENT)
positive: Callable[..., Any] = partial(declare, NUMBER, low=0, exclusive=True)


def choice(default: Any, meaning: str, choices: Any, **more: Any) -> Any:
    """One of some names: a sequence, or a mapping or enumeration of what each means."""
    return declare(CHOICE, default, meaning, choices=choices, **more)


def vector(
    count: int,
    default: Any,
    meaning: str,
    *limits: Any,
    kind: Callable[..., Any] = number,
    **more: Any,
) -> Any:
    """A list of ``count`` numbers, each with ``limits`` as `number` takes them."""
    part = kind(REQUIRED, "", *limits)
    return ListDeclaration(default=default, meaning=meaning, part=part, count=count, **more)


def many(default: Any, meaning: str, part: Declaration, **more: Any) -> Any:
    """A list of any number of values."""
    return ListDeclaration(default=default, meaning=meaning, part=part, **more)


Keys = Mapping[str, Declaration]
"""The keys of a table, by name."""


def _named(keys: Keys) -> dict[str, Declaration]:
    """Declarations with their names, and the units that end the names of numbers."""
    return {
        name: replace(one, name=name, unit=one.unit or _unit(name)) for name, one in keys.items()
    }


def _unit(name: str) -> str:
    _, *ends = name.split("_")
    rate = ends[-2:] in (["deg", "s"], ["km", "s"])
    own = {"c": "C", "ma": "mA"} | {unit: unit for unit in _UNITS}
    return "/".join(ends[-2:]) if rate else own.get("".join(ends[-1:]), "")


def described(keys: Keys) -> dict[str, dict[str, Any]]:
    """What each key is, as JSON has it."""
    return {name: one.described() for name, one in _named(keys).items()}


def read_table(given: Mapping[str, Any], keys: Keys) -> dict[str, Any]:
    """The checked values of a table; ValueError for an unknown, wrong or missing key."""
    values: dict[str, Any] = {}
    keys = _named(keys)
    now = {one.formerly: name for name, one in keys.items() if one.formerly}
    for word, value in given.items():
        name = now.get(word, word)
        if name not in keys:
            key = f"{word!r:.{LONGEST_SHOWN}}"
            raise ValueError(f"unknown key {key}; allowed are {', '.join(keys)}")
        if name in values:
            raise ValueError(f"{name} is given twice, once as {keys[name].formerly}")
        if name != word:
            text = f"the key {word} is deprecated and goes with the next version: write {name}"
            warnings.warn(text, FutureWarning, stacklevel=2)
        try:
            values[name] = keys[name].read(value)
        except ValueError as error:
            parts = value if isinstance(value, list) else [value]
            colon = ":" if any(isinstance(one, dict) for one in parts) else ""
            raise ValueError(f"{name}{colon} {error}") from None
    missing = [name for name, one in keys.items() if one.default is REQUIRED and name not in values]
    if missing:
        raise ValueError(f"needs the key{'s' * (len(missing) > 1)} {', '.join(missing)}")
    return values


@dataclass(frozen=True, kw_only=True)
class TableDeclaration(Declaration):
    """A table with ``keys``, or an array of such, written as ``[[NAME]]``.

    ``make`` is called with the values of each.
    """

    keys: Keys
    array: bool = False

    @property
    def wanted(self) -> str:
        return f"tables, each under [[{self.name}]]" if self.array else "a table"

    def read(self, given: Any) -> Any:
        """What ``make`` returns for the table, or a tuple of that for each of an array."""
        tables = given if self.array else [given]
        if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
            raise self.error(given)
        values = (read_table(one, self.keys) for one in tables)
        made = tuple(one if self.make is None else self.make(one) for one in values)
        return made if self.array else made[0]

    def described(self) -> dict[str, Any]:
        kind = "tables" if self.array else "table"
        return {**super().described(), "type": kind, "keys": described(self.keys)}


def table(default: Any, meaning: str, keys: Any, make: Any = None, **more: Any) -> Any:
    """A table with ``keys``, or one that makes ``keys``, a class of `DeclaredValues`."""
    if isinstance(keys, type):
        owner: Any = keys
        keys, make = owner.declared(), make or (lambda values: owner(**values))
    return TableDeclaration(default=default, meaning=meaning, keys=_named(keys), make=make, **more)


class DeclaredValues:
    """Base of frozen dataclasses that check their declared values on construction.

    A field is declared by a `Declaration` as its default, as in
    ``rate: float = number(1.0, "share of the bytes", 0, 1)``. Other fields are left alone.
    """

    error: ClassVar[type[ValueError]] = ValueError  #: raised for a value that is not allowed
    _declared: ClassVar[dict[str, Declaration]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        own = {name: one for name, one in vars(cls).items() if isinstance(one, Declaration)}
        cls._declared = {**cls._declared, **_named(own)}
        for name, one in own.items():
            setattr(cls, name, field() if one.default is REQUIRED else field(default=one.default))

    def __post_init__(self) -> None:
        for one in self._declared.values():
            self._check(one)

    @classmethod
    def declared(cls) -> dict[str, Any]:
        """The declarations by name, in the order of the fields."""
        return cls._declared

    @classmethod
    def refusal(cls, name: str, text: str) -> ValueError:
        """The error for the value ``name``, of which ``text`` says what it must be."""
        return cls.error(f"{name} {text}")

    def check_within(self, name: str, **limits: float) -> None:
        """Check a value against a ``low`` or ``high`` that depends on other values."""
        one, value = self._declared[name], getattr(self, name)
        inside = limits.get("low", value) <= value <= limits.get("high", value)
        if not inside or one.exclusive:
            self._check(replace(one, **limits))  # type: ignore[arg-type]

    def _check(self, one: Declaration) -> None:
        try:
            one.check(getattr(self, one.name))
        except ValueError as error:
            raise self.refusal(one.name, str(error)) from None
