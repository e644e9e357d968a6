"""Scene files: TOML with declared keys and values; Python's library only reads TOML."""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from cubestack.firmware_model.formats.untrusted import read_toml
from cubestack.firmware_model.values import read_table, text
from cubestack.firmware_model.versions import SCENE

V = TypeVar("V")


class SceneError(ValueError):
    """An impossible scene: a wrong value, key, file or picture. The text is one line."""


VERSION_KEY = "version"
"""Key of a scene file for the version of the format; without it, 1."""

DEVICE_KEYS = ("profile", "set")
"""Keys of a scene file for the device: the switches that it runs with."""


def device_keys(path: Path) -> dict[str, str]:
    """The keys of a scene file for the device; SceneError if one is not text.

    A file that can not be read as TOML gives none: the reader of the scene reports the error.
    """
    try:
        table = read_toml(Path(path))
    except (OSError, ValueError):
        return {}
    keys = dict.fromkeys(DEVICE_KEYS, text(None, "of the device"))
    try:
        return read_table({key: table[key] for key in DEVICE_KEYS if key in table}, keys)
    except ValueError as error:
        raise SceneError(str(error)) from None


def read_scene_file(
    path: Path, kinds: Mapping[str, Callable[[dict[str, Any]], V]], right: str
) -> V:
    """Read a scene file with the reader of its ``kind``; ``right`` names the accepted kinds.

    The reader gets the file's other keys, without ``DEVICE_KEYS`` and ``VERSION_KEY``. Raises as
    ``read_file``.
    """

    def scene(table: dict[str, Any]) -> V:
        SCENE.check(table.pop(VERSION_KEY, None))
        kind = table.pop("kind", None)
        table = {key: value for key, value in table.items() if key not in DEVICE_KEYS}
        if not isinstance(kind, str) or kind not in kinds:
            raise SceneError(f"kind must be {right}, not {kind!r:.80}")
        return kinds[kind](table)

    return read_file(path, scene)


def read_file(path: Path, reader: Callable[[dict[str, Any]], V]) -> V:
    """Return what ``reader`` makes of a TOML file.

    Raises:
        SceneError: the file can not be read or is not TOML, or ``reader`` raised a ValueError. The
            text starts with the file's name.
    """
    try:
        table = read_toml(Path(path), SceneError)
    except OSError as error:
        raise SceneError(f"{path} can not be read: {error.strerror or error}") from None
    try:
        return reader(table)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def values_for(owner: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of ``values`` that are fields of the dataclass ``owner``."""
    names = {field.name for field in fields(owner)}
    return {key: value for key, value in values.items() if key in names}


_BARE = re.compile(r"[A-Za-z0-9_-]+")
_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?")


def toml_text(table: Mapping[str, Any]) -> str:
    """``table`` as a TOML document.

    Values are numbers, texts, true and false, lists, tables, and lists of tables, else SceneError.
    A text such as 2013-06-01T20:00:00Z becomes a date and time.
    """
    return "".join(_lines(table, ()))


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    tables = {key: one for key, one in table.items() if _is_table(one)}
    lines = [f"{_key(key)} = {_value(one)}\n" for key, one in table.items() if key not in tables]
    for key, one in tables.items():
        name = ".".join(map(_key, (*path, key)))
        for part in one if isinstance(one, list) else [one]:
            lines.append(f"\n[[{name}]]\n" if isinstance(one, list) else f"\n[{name}]\n")
            lines += _lines(part, (*path, key))
    return lines


def _is_table(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(isinstance(one, Mapping) for one in value)
    return isinstance(value, Mapping)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _value(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float() if math.isfinite(value):
            return repr(value)
        case str():
            return value if _MOMENT.fullmatch(value) else _text(value)
        case list():
            return f"[{', '.join(map(_value, value))}]"
    raise SceneError(f"a scene file can not contain the value {value!r}")


def _text(value: str) -> str:
    # JSON's quoted text is TOML's basic string, except that JSON does not escape DEL.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
