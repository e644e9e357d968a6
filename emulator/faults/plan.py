"""A plan of faults: a seed, and what happens where, when and for how long; a TOML file.

::

    seed = 7

    [[fault]]
    kind = "uart-corrupt"
    at = 2.0               # s of virtual time; from the start unless given
    for = 0.5              # s; for ever unless given
    rate = 0.01            # parameters of the kind

    [[fault]]
    kind = "latch-up"
    target = "memory"      # the usual one of the device unless given
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubestack.emulator.faults.declaration import Fault, FaultError
from cubestack.emulator.faults.table import make_fault

_OWN = ("kind", "target", "at", "for")


@dataclass(frozen=True)
class PlannedFault:
    """A fault, its target, and its times in s; None as for ``Faults.inject``."""

    fault: Fault
    target: str | None = None
    at_s: float | None = None
    for_s: float | None = None


@dataclass(frozen=True)
class Plan:
    """Faults of one run.

    Attributes:
        seed: of everything random about them.
        faults: in the order in which they are injected.
        name: for messages.
    """

    seed: int = 0
    faults: tuple[PlannedFault, ...] = ()
    name: str = "plan"


def load_plan(path: Path) -> Plan:
    """Read a plan; FaultError names the file, and the fault that makes no sense."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no UTF-8 text"
        raise FaultError(f"{path}: {reason}: a plan of faults is a TOML file") from None
    return parse_plan(text, str(path))


def parse_plan(text: str, name: str = "plan") -> Plan:
    """Read the ``text`` of a plan; FaultError as for ``load_plan``."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FaultError(f"{name}: {error}") from None
    seed, entries = table.pop("seed", 0), table.pop("fault", [])
    if table:
        raise FaultError(f"{name}: no key {next(iter(table))!r}; a plan has seed and [[fault]]")
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise FaultError(f"{name}: seed must be a whole number from 0, not {seed!r}")
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise FaultError(f"{name}: faults are written as [[fault]]")
    faults = []
    for number, entry in enumerate(entries, start=1):
        try:
            faults.append(_planned(entry))
        except FaultError as error:
            raise FaultError(f"{name}: fault {number}: {error}") from None
    return Plan(seed, tuple(faults), name)


def _planned(entry: dict[str, Any]) -> PlannedFault:
    for key in ("at", "for"):
        value = entry.get(key)
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise FaultError(f"{key} must be a number of s, not {value!r}")
    for key in ("kind", "target"):
        if not isinstance(entry.get(key, ""), str):
            raise FaultError(f"{key} must be a text, not {entry[key]!r}")
    if "kind" not in entry:
        raise FaultError("it needs a kind")
    parameters = {key: value for key, value in entry.items() if key not in _OWN}
    fault = make_fault(entry["kind"], **parameters)
    return PlannedFault(fault, entry.get("target"), entry.get("at"), entry.get("for"))
