"""Entries of a table that the user names."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

Entry = TypeVar("Entry")


def chosen(table: Mapping[str, Entry], names: Sequence[str], kind: str) -> dict[str, Entry]:
    """The named entries, all without a name; ValueError when one is not in the table."""
    for name in names:
        if name not in table:
            raise ValueError(f"{name!r} is no {kind}; there are {', '.join(table)}")
    return {name: table[name] for name in names or table}
