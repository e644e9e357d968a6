"""A plan of faults: a TOML file with a seed, and the kind, target, time and duration of faults.

::

    version = 1            # of the format; default: 1
    seed = 7

    [[fault]]
    kind = "uart-corrupt"
    at_s = 2.0             # virtual time; default: the start
    for_s = 0.5            # duration; default: unlimited
    rate = 0.01            # parameters of the kind

    [[fault]]
    kind = "latch-up"
    target = "memory"      # default: the first one of the device
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubestack.emulator.faults.declaration import TIMES, Fault, FaultError
from cubestack.emulator.faults.table import make_fault
from cubestack.firmware_model.formats.untrusted import parse_toml, read_text
from cubestack.firmware_model.values import REQUIRED, read_table, text, whole
from cubestack.firmware_model.versions import FAULT_PLAN

_SEED = whole(0, "seed of the random numbers", 0)
_OWN = {"kind": text(REQUIRED, "kind of fault"), "target": text(None, "target"), **TIMES}


@dataclass(frozen=True)
class PlannedFault:
    """A fault, its target, and its times in s; None as for ``Faults.inject``."""

    fault: Fault
    target: str | None = None
    at_s: float | None = None
    for_s: float | None = None


@dataclass(frozen=True)
class Plan:
    """The faults of one run, as a plan file declares them."""

    seed: int = 0  # seed of their random numbers
    faults: tuple[PlannedFault, ...] = ()  # in the order of injection
    name: str = "plan"  # name in messages


def load_plan(path: Path) -> Plan:
    """Read a plan; FaultError names the file, and the invalid fault."""
    try:
        return parse_plan(read_text(path, error=FaultError), str(path))
    except OSError as error:
        raise FaultError(f"{path}: {error.strerror}; a plan of faults is a TOML file") from None


def parse_plan(text: str, name: str = "plan") -> Plan:
    """Read the ``text`` of a plan; FaultError as for ``load_plan``."""
    table = parse_toml(text, name, FaultError)
    seed, entries = table.pop("seed", 0), table.pop("fault", [])
    try:
        FAULT_PLAN.check(table.pop("version", None))
    except ValueError as error:
        raise FaultError(f"{name}: {error}") from None
    if table:
        raise FaultError(
            f"{name}: unknown key {next(iter(table))!r}; a plan has seed and [[fault]]"
        )
    try:
        _SEED.check(seed)
    except ValueError as error:
        raise FaultError(f"{name}: seed {error}") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise FaultError(f"{name}: fault must be an array of tables, [[fault]]")
    faults = []
    for number, entry in enumerate(entries, start=1):
        try:
            faults.append(_planned(entry))
        except ValueError as error:
            raise FaultError(f"{name}: fault {number}: {error}") from None
    return Plan(seed, tuple(faults), name)


def _planned(entry: dict[str, Any]) -> PlannedFault:
    words = {*_OWN, *(one.formerly for one in _OWN.values())}
    own = read_table({key: value for key, value in entry.items() if key in words}, _OWN)
    parameters = {key: value for key, value in entry.items() if key not in words}
    return PlannedFault(make_fault(own.pop("kind"), **parameters), **own)
