"""Scene files: TOML tables with checked keys and values.

A reader takes what TOML gave for one key and returns the checked value; SceneError says what it
must be. :func:`read_table` puts the key in front.
"""

import sys
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cubestack.emulator.scene.picture import SceneError

__all__ = [
    "Readers",
    "SceneError",
    "flag",
    "load_toml",
    "number",
    "read_table",
    "several",
    "text",
    "whole",
]

Readers = dict[str, Callable[[Any], Any]]


def load_toml(path: Path) -> dict[str, Any]:
    """What stands in the file; SceneError when it can not be read or is no TOML."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path} can not be read: {error.strerror or error}") from None
    except ValueError as error:
        raise SceneError(f"{path} is no TOML file: {error}") from None


def read_table(table: Mapping[str, Any], readers: Readers) -> dict[str, Any]:
    """Checked values of ``table``; SceneError for keys and values that ``readers`` do not take."""
    values = {}
    for key, value in table.items():
        if key not in readers:
            raise SceneError(f"unknown key {key!r}; allowed are {', '.join(readers)}")
        try:
            values[key] = readers[key](value)
        except ValueError as error:
            raise SceneError(
                f"{key}: {error}" if isinstance(value, dict) else f"{key} {error}"
            ) from None
    return values


def number(value: Any) -> float:
    """A finite number."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not abs(value) <= sys.float_info.max
    ):
        raise SceneError(f"must be a number, not {value!r}")
    return float(value)


def whole(value: Any) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise SceneError(f"must be a whole number, not {value!r}")
    return value


def flag(value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise SceneError(f"must be true or false, not {value!r}")
    return value


def text(value: Any) -> str:
    """A string."""
    if not isinstance(value, str):
        raise SceneError(f"must be text, not {value!r}")
    return value


def several(count: int, of: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    """A reader of ``count`` values, each of them read by ``of``."""

    def read(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise SceneError(f"must be a list of {count} numbers, not {value!r}")
        return tuple(of(item) for item in value)

    return read
