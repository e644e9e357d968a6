"""Tables of declared values, as TOML files have them: keys, tables in tables, tables by kind."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cubestack.firmware_model.values.declaration import REQUIRED, UNITS, Declaration

Keys = Mapping[str, Declaration]
"""The keys of a table, by name."""


def named(keys: Mapping[str, Declaration]) -> dict[str, Declaration]:
    """Declarations with their names, and the units that the names say."""
    return {
        name: replace(one, name=name, unit=one.unit or _unit(name)) for name, one in keys.items()
    }


def _unit(name: str) -> str:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def with_defaults(keys: Keys, owner: Any) -> dict[str, Declaration]:
    """Declarations whose defaults are the attributes of ``owner``."""
    return {name: replace(one, default=getattr(owner, name)) for name, one in keys.items()}


def described(keys: Keys) -> dict[str, dict[str, Any]]:
    """What each key is, as JSON has it."""
    return {name: one.described() for name, one in keys.items()}


def read_table(given: Mapping[str, Any], keys: Keys) -> dict[str, Any]:
    """The checked values of a table; ValueError for an unknown, wrong or missing key."""
    values: dict[str, Any] = {}
    now = {one.formerly: name for name, one in keys.items()}
    for word, value in given.items():
        name = now.get(word, word)
        if name not in keys:
            raise ValueError(f"unknown key {word!r}; allowed are {', '.join(keys)}")
        if name in values:
            raise ValueError(f"{name} is given twice, once as {keys[name].formerly}")
        if name != word:
            text = f"the key {word} is deprecated and goes with the next version: write {name}"
            warnings.warn(text, FutureWarning, stacklevel=2)
        try:
            values[name] = keys[name].read(value)
        except ValueError as error:
            parts = value if isinstance(value, list) else [value]
            colon = ":" if any(isinstance(one, dict) for one in parts) else ""
            raise ValueError(f"{name}{colon} {error}") from None
    missing = [name for name, one in keys.items() if one.default is REQUIRED and name not in given]
    if missing:
        raise ValueError(f"needs the key{'s' * (len(missing) > 1)} {', '.join(missing)}")
    return values


@dataclass(frozen=True, kw_only=True)
class TableDeclaration(Declaration):
    """A table, or an array of tables.

    Attributes:
        keys: of each table; ``make`` is given their values.
        array: whether it is an array, written as ``[[NAME]]``.
    """

    keys: Keys
    array: bool = False

    @property
    def wanted(self) -> str:
        """What it must be, in words."""
        return f"tables, each under [[{self.name}]]" if self.array else "a table"

    def read(self, given: Any) -> Any:
        """What ``make`` returns for the table, or a tuple of that for each of an array."""
        tables = given if self.array else [given]
        if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
            raise self.error(given)
        values = (read_table(one, self.keys) for one in tables)
        made = tuple(one if self.make is None else self.make(one) for one in values)
        return made if self.array else made[0]

    def described(self) -> dict[str, Any]:
        """As JSON has it, with its ``keys``."""
        kind = "tables" if self.array else "table"
        return {**super().described(), "type": kind, "keys": described(self.keys)}


def table(
    default: Any,
    meaning: str,
    keys: Any,
    make: Callable[[dict[str, Any]], Any] | None = None,
    **more: Any,
) -> Any:
    """A table with ``keys``, or one that makes ``keys``, a class of `DeclaredValues`."""
    if isinstance(keys, type):
        owner: Any = keys
        keys, make = owner.declared(), make or (lambda values: owner(**values))
    return TableDeclaration(default=default, meaning=meaning, keys=named(keys), make=make, **more)


@dataclass(frozen=True, kw_only=True)
class KindsDeclaration(Declaration):
    """Tables by kind, as ``[hazards.moon]``; several of a kind are ``[[hazards.debris]]``.

    Attributes:
        kinds: classes of `DeclaredValues` with a ``meaning``, by name.
        defaults: values of keys that a table leaves out.
    """

    kinds: Mapping[str, Any]
    defaults: Mapping[str, Any] = field(default_factory=dict)

    @property
    def wanted(self) -> str:
        """What it must be, in words."""
        return "a table"

    def read(self, given: Any) -> tuple[Any, ...]:
        """An object for each table."""
        if not isinstance(given, dict):
            raise self.error(given)
        keys = {
            name: self._table(kind, isinstance(given.get(name), list))
            for name, kind in self.kinds.items()
        }
        made = read_table(given, keys).values()
        return tuple(one for some in made for one in (some if isinstance(some, tuple) else [some]))

    def _table(self, kind: Any, array: bool) -> TableDeclaration:
        made: TableDeclaration = table(
            None, "", kind, lambda values: kind(**{**self.defaults, **values}), array=array
        )
        return made

    def described(self) -> dict[str, Any]:
        """As JSON has it, with ``meaning`` and ``keys`` of each of the ``kinds``."""
        kinds = {
            name: {"meaning": kind.meaning, "keys": described(kind.declared())}
            for name, kind in self.kinds.items()
        }
        return {**super().described(), "type": "kinds", "kinds": kinds}
