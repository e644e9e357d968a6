"""Scene files: TOML with declared keys and values."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from cubestack.firmware_model.values import named, read_table, text

V = TypeVar("V")


class SceneError(ValueError):
    """A scene that can not be: a wrong value, key, file or picture. The text is one line."""


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
    keys = named(dict.fromkeys(DEVICE_KEYS, text(None, "of the device")))
    try:
        return read_table({key: table[key] for key in DEVICE_KEYS if key in table}, keys)
    except ValueError as error:
        raise SceneError(str(error)) from None


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
