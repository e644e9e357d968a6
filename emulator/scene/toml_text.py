"""Writes tables as TOML, which Python's library only reads."""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from cubestack.emulator.scene.file import SceneError

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
