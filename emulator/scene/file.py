"""Tables of scene files: TOML with checked keys and values.

A reader takes what TOML gave for one key and returns the checked value; SceneError says what it
must be. :func:`read_table` puts the key in front.
"""

import math
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

Readers = dict[str, Callable[[Any], Any]]
V = TypeVar("V")


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


def number(value: Any) -> float:
    """A finite number."""
    if type(value) not in (int, float) or not abs(value) <= sys.float_info.max:
        raise SceneError(f"must be a number, not {value!r}")
    return float(value)


def within(low: float, high: float) -> Callable[[Any], float]:
    """A reader of a number in these limits."""

    def read(value: Any) -> float:
        if not low <= number(value) <= high:
            raise SceneError(f"must be {low:g} to {high:g}, not {value:g}")
        return float(value)

    return read


angle = within(-360, 360)
declination = within(-90, 90)


def _exactly(kind: type[V], what: str) -> Callable[[Any], V]:
    def read(value: Any) -> V:
        if type(value) is not kind:
            raise SceneError(f"must be {what}, not {value!r}")
        return value

    return read


whole = _exactly(int, "a whole number")
flag = _exactly(bool, "true or false")
text = _exactly(str, "text")
moment = _exactly(datetime, "a date and time, as 2013-06-01T20:00:00Z")


def one_of(values: Mapping[str, V]) -> Callable[[Any], V]:
    """A reader of a name, which stands for one of ``values``."""

    def read(value: Any) -> V:
        if not isinstance(value, str) or value not in values:
            raise SceneError(f"must be one of {list(values)}, not {value!r}")
        return values[value]

    return read


def several(count: int, of: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    """A reader of ``count`` values, each of them read by ``of``."""

    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise SceneError(f"must be a list of {count} numbers, not {value!r}")
        return tuple(of(item) for item in value)

    return read


def subtable(readers: Readers) -> Callable[[Any], dict[str, Any]]:
    """A reader of a table, whose keys ``readers`` take."""

    def read(value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise SceneError(f"must be a table, not {value!r}")
        return read_table(value, readers)

    return read


def readers_of(kind: type[Any]) -> Readers:
    """Readers of the fields of a dataclass, by their types: keys of a table that makes one.

    Types are float, int, bool, str, datetime, tuples of one of them, and each of those or None.
    """
    hints = get_type_hints(kind)
    return {field.name: _reader(hints[field.name]) for field in fields(kind) if field.init}


def _reader(hint: Any) -> Callable[[Any], Any]:
    if get_origin(hint) is UnionType:
        (hint,) = (part for part in get_args(hint) if part is not type(None))
    if get_origin(hint) is tuple:
        of, *others = get_args(hint)
        if others == [...]:
            return _list_of(_reader(of))
        return several(1 + len(others), _reader(of))
    simple = {float: number, int: whole, bool: flag, str: text, datetime: moment}
    return simple[hint]


def _list_of(of: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise SceneError(f"must be a list, not {value!r}")
        return tuple(of(item) for item in value)

    return read


def made_of(kinds: Mapping[str, type[V]], **defaults: Any) -> Callable[[Any], tuple[V, ...]]:
    """A reader of tables by name, as ``[hazards.moon]``: each makes a dataclass of ``kinds``.

    Several of a kind are an array of tables, as ``[[hazards.debris]]``. ``defaults`` stand for keys
    that a table leaves out.
    """

    def make(kind: type[V]) -> Callable[[Any], tuple[V, ...]]:
        read = subtable(readers_of(kind))
        return lambda value: tuple(
            kind(**(defaults | read(table)))
            for table in (value if isinstance(value, list) else [value])
        )

    makers = subtable({name: make(kind) for name, kind in kinds.items()})
    return lambda value: tuple(thing for things in makers(value).values() for thing in things)
