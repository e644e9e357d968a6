"""Scene files: TOML with declared keys and values."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from cubestack.firmware_model.values import read_table, text

V = TypeVar("V")


class SceneError(ValueError):
    """An impossible scene: a wrong value, key, file or picture. The text is one line."""


DEVICE_KEYS = ("profile", "set")
"""Keys of a scene file for the device: the switches that it runs with."""


def device_keys(path: Path) -> dict[str, str]:
    """The keys of a scene file for the device; SceneError if one is not text.

    A file that can not be read as TOML gives none: the reader of the scene reports the error.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
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

    The reader gets the file's other keys, without ``DEVICE_KEYS``. Raises as ``read_file``.
    """

    def scene(table: dict[str, Any]) -> V:
        kind = table.pop("kind", None)
        table = {key: value for key, value in table.items() if key not in DEVICE_KEYS}
        if not isinstance(kind, str) or kind not in kinds:
            raise SceneError(f"kind must be {right}, not {kind!r}")
        return kinds[kind](table)

    return read_file(path, scene)


def read_file(path: Path, reader: Callable[[dict[str, Any]], V]) -> V:
    """Return what ``reader`` makes of a TOML file.

    Raises:
        SceneError: the file can not be read or is not TOML, or ``reader`` raised a ValueError. The
            text starts with the file's name.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path} can not be read: {error.strerror or error}") from None
    except ValueError as error:
        raise SceneError(f"{path} is not a TOML file: {error}") from None
    try:
        return reader(table)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def values_for(owner: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of ``values`` that are fields of the dataclass ``owner``."""
    names = {field.name for field in fields(owner)}
    return {key: value for key, value in values.items() if key in names}
