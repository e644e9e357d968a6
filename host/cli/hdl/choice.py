"""Entries of a table that the user names."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

Entry = TypeVar("Entry")


def chosen(table: Mapping[str, Entry], names: Sequence[str], kind: str) -> dict[str, Entry]:
    """The entries whose names are given or start with a given text; all without one.

    An exact name selects nothing else. ValueError with all names when a text fits none.
    """
    found: dict[str, Entry] = {}
    for name in names or [""]:
        fitting = [name] if name in table else [entry for entry in table if entry.startswith(name)]
        if not fitting:
            raise ValueError(f"{name!r} is no {kind}; there are {', '.join(table)}")
        found |= {entry: table[entry] for entry in fitting}
    return found


def one(table: Mapping[str, Entry], name: str, kind: str) -> tuple[str, Entry]:
    """The entry that :func:`chosen` selects; ValueError when several are."""
    found = chosen(table, [name], kind)
    if len(found) > 1:
        raise ValueError(f"{name!r} fits {', '.join(found)}; say which")
    return next(iter(found.items()))
