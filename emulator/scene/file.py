"""Tables of scene files: TOML with checked keys and values.

A :class:`Reader` takes what TOML gave for one key and returns the checked value; SceneError says
what it must be. :func:`read_table` puts the key in front. What a reader takes it also tells, for
whoever makes a form of it: ``emulator.scene.keys``.
"""

import math
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime
from pathlib import Path
from types import UnionType
from typing import Any, Generic, TypeVar, get_args, get_origin, get_type_hints

V = TypeVar("V")
V_co = TypeVar("V_co", covariant=True)


@dataclass(frozen=True)
class Reader(Generic[V_co]):
    """What a key takes.

    Attributes:
        read: the checked value of what TOML gave; SceneError for a wrong one.
        about: ``type``; of a "number" or a "whole" one ``low`` and ``high``, of a "choice"
            ``choices``, of a "list" ``count`` and what it is ``of``, of a "table", of "tables" and
            of "kinds" of them ``readers``, and ``owners`` of defaults and limits.
    """

    read: Callable[[Any], V_co]
    about: Mapping[str, Any]

    def __call__(self, value: Any) -> V_co:
        """The checked value."""
        return self.read(value)

    def told(self, meaning: str = "", **more: Any) -> "Reader[V_co]":
        """The same with more to tell: ``meaning``, ``default``, ``unit``, ``low``, ``high``.

        ``instead`` are keys that it stands for. ``role`` is "ra", "dec" or "roll" of the camera at
        time 0, or the "direction" of something.
        """
        return replace(self, about={**self.about, "meaning": meaning, **more})


Readers = Mapping[str, Callable[[Any], Any]]
"""By key; each a `Reader`, or a function of which nothing is told."""


def _about(reader: Callable[[Any], Any]) -> Mapping[str, Any]:
    return reader.about if isinstance(reader, Reader) else {}


class SceneError(ValueError):
    """A scene that can not be: a wrong value, key, file or picture. The text is one line."""


def refuse_negative(thing: Any, *names: str) -> None:
    """Raise SceneError when one of these attributes is below 0 or not finite."""
    for name in names:
        if not 0 <= getattr(thing, name) < math.inf:
            raise SceneError(f"{name} must not be negative, not {getattr(thing, name)}")


def refuse_zero(thing: Any, *names: str) -> None:
    """Raise SceneError when one of these attributes is not above 0, or not finite."""
    for name in names:
        if not 0 < getattr(thing, name) < math.inf:
            raise SceneError(f"{name} must be above 0, not {getattr(thing, name)}")


def refuse_outside(thing: Any, **limits: tuple[float, float]) -> None:
    """Raise SceneError when one of these attributes, or a number in it, is not within its limits.

    None is within all.
    """
    for name, (low, high) in limits.items():
        value = getattr(thing, name)
        for one in value if isinstance(value, tuple) else (value,):
            if one is not None and not low <= one <= high:
                raise SceneError(f"{name} must be {low:g} to {high:g}, not {one:g}")


DEVICE_KEYS = ("profile", "set")
"""Keys of a scene file that are for the device that looks at it: which switches it runs with."""


def device_keys(path: Path) -> dict[str, str]:
    """What a scene file says of the device that looks at it, by key; SceneError for no text.

    Nothing for a file that can not be read as TOML: what is wrong with it, its reader tells.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    readers: Readers = dict.fromkeys(DEVICE_KEYS, text)
    return read_table({key: table[key] for key in DEVICE_KEYS if key in table}, readers)


def read_scene_file(
    path: Path, kinds: Mapping[str, Callable[[dict[str, Any]], V]], right: str
) -> V:
    """What the reader of its ``kind`` makes of the file's other keys; ``right`` tells the kinds.

    The keys of ``DEVICE_KEYS`` are left out, as a scene knows no device.

    Raises as ``read_file``.
    """

    def scene(table: dict[str, Any]) -> V:
        kind = table.pop("kind", None)
        table = {key: value for key, value in table.items() if key not in DEVICE_KEYS}
        if not isinstance(kind, str) or kind not in kinds:
            raise SceneError(f"kind must be {right}, not {kind!r}")
        return kinds[kind](table)

    return read_file(path, scene)


def read_file(path: Path, reader: Callable[[dict[str, Any]], V]) -> V:
    """What ``reader`` makes of a TOML file.

    Raises SceneError, with the file's name, for one that can not be read or is no TOML, and for
    what ``reader`` refuses by a ValueError.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path} can not be read: {error.strerror or error}") from None
    except ValueError as error:
        raise SceneError(f"{path} is no TOML file: {error}") from None
    try:
        return reader(table)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def values_for(owner: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of ``values`` that the dataclass ``owner`` has a field for."""
    names = {field.name for field in fields(owner)}
    return {key: value for key, value in values.items() if key in names}


def read_table(table: Mapping[str, Any], readers: Readers) -> dict[str, Any]:
    """Checked values of ``table``; SceneError for keys and values that ``readers`` do not take."""
    values = {}
    for key, value in table.items():
        if key not in readers:
            raise SceneError(f"unknown key {key!r}; allowed are {', '.join(readers)}")
        try:
            values[key] = readers[key](value)
        except ValueError as error:
            colon = ":" if isinstance(value, dict) else ""
            raise SceneError(f"{key}{colon} {error}") from None
    return values


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not abs(value) <= sys.float_info.max:
        raise SceneError(f"must be a number, not {value!r}")
    return float(value)


number = Reader(_number, {"type": "number"})
"""A finite number."""


def within(low: float, high: float) -> Reader[float]:
    """A reader of a number in these limits."""

    def read(value: Any) -> float:
        if not low <= number(value) <= high:
            raise SceneError(f"must be {low:g} to {high:g}, not {value:g}")
        return float(value)

    return Reader(read, {"type": "number", "low": low, "high": high})


angle = within(-360, 360)
declination = within(-90, 90)


def _exactly(kind: type[V], about: str, what: str) -> Reader[V]:
    def read(value: Any) -> V:
        if type(value) is not kind:
            raise SceneError(f"must be {what}, not {value!r}")
        return value

    return Reader(read, {"type": about})


whole = _exactly(int, "whole", "a whole number")
flag = _exactly(bool, "flag", "true or false")
text = _exactly(str, "text", "text")
moment = _exactly(datetime, "moment", "a date and time, as 2013-06-01T20:00:00Z")


def one_of(values: Mapping[str, V]) -> Reader[V]:
    """A reader of a name, which stands for one of ``values``."""

    def read(value: Any) -> V:
        if not isinstance(value, str) or value not in values:
            raise SceneError(f"must be one of {list(values)}, not {value!r}")
        return values[value]

    return Reader(read, {"type": "choice", "choices": list(values)})


def several(count: int, of: Callable[[Any], Any]) -> Reader[tuple[Any, ...]]:
    """A reader of ``count`` values, each of them read by ``of``."""

    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise SceneError(f"must be a list of {count} numbers, not {value!r}")
        return tuple(of(item) for item in value)

    return Reader(read, {"type": "list", "count": count, "of": _about(of)})


def subtable(readers: Readers, *owners: Any) -> Reader[dict[str, Any]]:
    """A reader of a table, whose keys ``readers`` take; ``owners`` have defaults and limits."""

    def read(value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise SceneError(f"must be a table, not {value!r}")
        return read_table(value, readers)

    return Reader(read, {"type": "table", "readers": readers, "owners": owners})


def readers_of(kind: type[Any]) -> dict[str, Reader[Any]]:
    """Readers of the fields of a dataclass, by their types: keys of a table that makes one.

    Types are float, int, bool, str, datetime, tuples of one of them, and each of those or None.
    What is in the fields' metadata is told.
    """
    hints = get_type_hints(kind)
    return {
        field.name: _reader(hints[field.name]).told(**_told_by(field.metadata))
        for field in fields(kind)
        if field.init
    }


def _told_by(metadata: Mapping[str, Any]) -> dict[str, Any]:
    low, high = metadata.get("range", (-math.inf, math.inf))
    limits = {"low": low, "high": high} if math.isfinite(high - low) else {}
    return {key: metadata[key] for key in ("meaning", "role") if key in metadata} | limits


def _reader(hint: Any) -> Reader[Any]:
    if get_origin(hint) is UnionType:
        (hint,) = (part for part in get_args(hint) if part is not type(None))
    if get_origin(hint) is tuple:
        of, *others = get_args(hint)
        if others == [...]:
            return list_of(_reader(of))
        return several(1 + len(others), _reader(of))
    simple: dict[Any, Reader[Any]] = {float: number, int: whole, bool: flag, str: text}
    return simple[hint] if hint in simple else {datetime: moment}[hint]


def list_of(of: Callable[[Any], Any]) -> Reader[tuple[Any, ...]]:
    """A reader of any number of values, each of them read by ``of``."""

    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise SceneError(f"must be a list, not {value!r}")
        return tuple(of(item) for item in value)

    return Reader(read, {"type": "list", "count": None, "of": _about(of)})


def made_of(kinds: Mapping[str, type[V]], **defaults: Any) -> Reader[tuple[V, ...]]:
    """A reader of tables by name, as ``[hazards.moon]``: each makes a dataclass of ``kinds``.

    Several of a kind are an array of tables, as ``[[hazards.debris]]``. ``defaults`` stand for keys
    that a table leaves out.
    """

    def make(kind: type[V]) -> Reader[tuple[V, ...]]:
        readers = readers_of(kind)
        table = subtable(readers, kind)

        def read(value: Any) -> tuple[V, ...]:
            tables = value if isinstance(value, list) else [value]
            return tuple(kind(**(defaults | table(one))) for one in tables)

        meaning = getattr(kind, "meaning", "")
        return Reader(read, {**table.about, "type": "tables"}).told(meaning)

    makers = subtable({name: make(kind) for name, kind in kinds.items()})

    def read(value: Any) -> tuple[V, ...]:
        return tuple(thing for things in makers(value).values() for thing in things)

    return Reader(read, {**makers.about, "type": "kinds"})
