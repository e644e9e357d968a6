"""Measurements of a page, stored with the code and the data that they depend on.

A file has entries (files, or names in them) with the digests that they had, and for each
measurement its call, figures, time and the entries that it depends on, by number.
"""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubestack.host.output import write_output
from cubestack.host.studies.rows.estimate import Estimate
from cubestack.host.studies.rows.sources import digest
from cubestack.host.studies.rows.trial import Figures

DIGITS = 10


@dataclass(frozen=True)
class Measurement:
    """One that was made."""

    call: str  #: what was called, with its arguments and seeds
    seconds: float  #: processor time that it took
    figures: Figures
    depends: tuple[str, ...]  #: entries, each with its digest after a blank

    @property
    def changed(self) -> list[str]:
        """Files that are not as they were when it was made."""
        pairs = (one.rpartition(" ") for one in self.depends)
        return sorted({entry.partition(":")[0] for entry, _, was in pairs if digest(entry) != was})


def measurement(call: str, seconds: float, figures: Figures, entries: Iterable[str]) -> Measurement:
    """One that was made just now."""
    return Measurement(call, seconds, figures, tuple(f"{one} {digest(one)}" for one in entries))


def load(path: Path) -> dict[str, Measurement]:
    """Measurements of a file by key; none if it is not there or holds something else."""
    if not path.is_file():
        return {}
    stored = json.loads(path.read_text("utf-8"))
    entries = stored.get("depends", [])
    return {
        key: Measurement(
            one["call"],
            one["seconds"],
            {name: _value(value) for name, value in one["figures"].items()},
            tuple(entries[at] for at in _numbers(one["depends"])),
        )
        for key, one in stored.get("measurements", {}).items()
    }


def save(path: Path, measurements: dict[str, Measurement]) -> None:
    """Write them sorted, one in a line."""
    entries = sorted({entry for one in measurements.values() for entry in one.depends})
    numbers = {entry: at for at, entry in enumerate(entries)}
    lines = [
        json.dumps(key)
        + ": "
        + json.dumps(
            {
                "call": one.call,
                "seconds": round(one.seconds, 1),
                "figures": {name: _stored(value) for name, value in one.figures.items()},
                "depends": _ranges(numbers[entry] for entry in one.depends),
            }
        )
        for key, one in sorted(measurements.items())
    ]
    listed = ",\n".join(json.dumps(entry) for entry in entries)
    path.parent.mkdir(parents=True, exist_ok=True)
    text = '{"measurements": {\n' + ",\n".join(lines) + '\n},\n"depends": [\n' + listed + "\n]}\n"
    write_output(path, text)


def _stored(value: float) -> Any:
    def rounded(one: float) -> float | None:
        return float(f"{one:.{DIGITS}g}") if math.isfinite(one) else None

    if isinstance(value, Estimate):
        return [rounded(float(value)), rounded(value.low), rounded(value.high)]
    return rounded(value)


def _value(stored: Any) -> float:
    if isinstance(stored, list):
        value, low, high = (math.nan if one is None else one for one in stored)
        return Estimate(value, low, high)
    return math.nan if stored is None else stored


def staleness(stored: Measurement | None, call: str) -> str:
    """Why ``stored`` is not what ``call`` would measure now; empty if it is."""
    if stored is None:
        return "never measured"
    if stored.call != call:
        return f"it was {stored.call}"
    return f"changed since: {', '.join(stored.changed)}" if stored.changed else ""


def as_stored(figures: Figures) -> Figures:
    """Figures as they come back from a file: with ``DIGITS`` digits."""
    return {name: _value(_stored(value)) for name, value in figures.items()}


def _ranges(numbers: Iterable[int]) -> str:
    """As "0-57 60"."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return " ".join(f"{low}-{high}" if high > low else f"{low}" for low, high in found)


def _numbers(ranges: str) -> Iterator[int]:
    for one in ranges.split():
        low, _, high = one.partition("-")
        yield from range(int(low), int(high or low) + 1)
