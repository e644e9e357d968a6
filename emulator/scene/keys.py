"""What the keys of scene files are, told from what reads them: for forms and documents.

Types, choices and meanings are those of the readers; defaults and limits those of the dataclasses
whose values the keys give.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np

from cubestack.emulator.scene.file import Reader, Readers

UNITS = {
    "_deg_s": "deg/s",
    "_km_s": "km/s",
    "_deg": "deg",
    "_arcsec": "arcsec",
    "_km": "km",
    "_mm": "mm",
    "_um": "um",
    "_px": "px",
    "_c": "C",
    "_ms": "ms",
    "_mag": "mag",
    "_m": "m",
    "_s": "s",
}
"""Unit of a key by the end of its name; the first that fits."""

TOLD = ("meaning", "low", "high", "choices", "count", "instead", "role")

Told = dict[str, Any]


def declared(readers: Readers, *owners: Any) -> dict[str, Told]:
    """What each key is, by its name, as JSON has it.

    ``type``, ``unit`` and ``default``, None where there is none, and where there are some: what
    `Reader.told` lists, ``of`` a list its parts, ``keys`` of tables, ``kinds`` of tables by name.
    Functions that tell nothing are left out.

    Args:
        readers: by name.
        owners: dataclasses, or such things, with defaults, and limits as ``LIMITS``; the first that
            has a name counts.
    """
    return {
        name: _told(name, reader, owners)
        for name, reader in readers.items()
        if isinstance(reader, Reader)
    }


def _told(name: str, reader: Reader[Any], owners: tuple[Any, ...]) -> Told:
    about = reader.about
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    found: Told = {"type": about["type"], "unit": unit, "default": _default(name, owners)}
    for owner in owners:
        if limits := getattr(owner, "LIMITS", {}).get(name):
            found |= dict(zip(("low", "high"), limits, strict=True))
    found |= {key: about[key] for key in TOLD if key in about}
    found |= {key: plain(about[key]) for key in ("default", "unit") if key in about}
    if "of" in about:
        found["of"] = {key: one for key, one in about["of"].items() if key in ("type", *TOLD)}
        if about["of"].get("type") == "list":
            found["of"]["of"] = dict(about["of"]["of"])
    if about["type"] == "kinds":
        found["kinds"] = {
            kind: {"meaning": one.about["meaning"], "keys": _keys(one.about)}
            for kind, one in about["readers"].items()
        }
    elif "readers" in about:
        found["keys"] = _keys(about)
    return found


def _keys(about: Mapping[str, Any]) -> dict[str, Told]:
    return declared(about["readers"], *about["owners"])


def _default(name: str, owners: tuple[Any, ...]) -> Any:
    for owner in owners:
        if hasattr(owner, name) and not isinstance(getattr(owner, name), property):
            return plain(getattr(owner, name))
    return None


def plain(value: Any) -> Any:
    """``value`` as TOML and JSON have it: numbers, texts, lists; None where it has no such form."""
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, tuple | list):
        parts = [plain(one) for one in value]
        return None if None in parts else parts
    return value if isinstance(value, bool | int | float | str) else None
