"""Cycle costs of a processor's operations, and the meter that adds them up.

An algorithm charges the operations that its program would have executed, counted as they really
happened; the table of its part (a module beside this one) turns the counts into cycles.
"""

from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

Provenance = Literal["measured", "published", "fitted", "assumed"]


class CostError(ValueError):
    """A cost, a table or a charge that makes no sense; the message names the offender."""


@dataclass(frozen=True)
class Cost:
    """What one operation costs, in processor cycles, and why we think so."""

    cycles: int
    provenance: Provenance
    source: str

    def __post_init__(self) -> None:
        """Refuse costs that are not positive, not tagged or not explained."""
        if self.cycles < 1:
            raise CostError(f"a cost must be at least 1 cycle, not {self.cycles}")
        if self.provenance not in get_args(Provenance):
            known = ", ".join(get_args(Provenance))
            raise CostError(f"provenance must be one of {known}, not {self.provenance!r}")
        if not self.source:
            raise CostError(f"a cost of {self.cycles} cycles needs a source")


@dataclass(frozen=True)
class CostTable:
    """The operations of one processor, by name, at one clock."""

    name: str
    clock_hz: int
    operations: Mapping[str, Cost]

    @cached_property
    def cycles(self) -> dict[str, int]:
        """What each operation takes."""
        return {name: cost.cycles for name, cost in self.operations.items()}

    def seconds(self, cycles: int) -> float:
        """Duration of so many cycles, in seconds."""
        return cycles / self.clock_hz


@dataclass(eq=False)
class Meter:
    """Counts a program's operations by name, and cycles: in all, and over all visits of a phase.

    Attributes:
        table: of the processor.
        total, counts, phases: cycles in all, operations by name, cycles by phase.
        phase_now: of the innermost block; set by ``phase``.
    """

    table: CostTable
    total: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    phases: dict[str, int] = field(default_factory=dict)
    _taken: int = 0
    phase_now: str | None = None

    def charge(self, **operations: int) -> None:
        """Charge each named operation so many times.

        Raises:
            CostError: for an operation that the table does not have, or a negative count.
        """
        cycles, counts, table = 0, self.counts, self.table.cycles
        try:
            for name, count in operations.items():
                if count < 0:
                    raise CostError(f"operation {name!r} cannot happen {count} times")
                cycles += table[name] * count
                counts[name] += count
        except KeyError as unknown:
            known = ", ".join(sorted(table))
            raise CostError(
                f"operation {unknown} is not in the table of {self.table.name} (it has {known})"
            ) from None
        self.total += cycles
        if self.phase_now is not None:
            self.phases[self.phase_now] += cycles

    def charge_all(self, phases: Mapping[str, Mapping[str, int]], limit: int) -> bool:
        """Charge operations by phase, unless the total would be above a limit; whether it did.

        What `phase` and `charge` do one by one, in half of the model's time.

        Raises:
            KeyError: for an operation that the table does not have.
        """
        table = self.table.cycles
        taken = {
            phase: sum([table[name] * count for name, count in operations.items()])
            for phase, operations in phases.items()
        }
        total = self.total + sum(taken.values())
        if total > limit:
            return False
        self.total = total
        for phase, cycles in taken.items():
            self.phases[phase] = self.phases.get(phase, 0) + cycles
            for name, count in phases[phase].items():
                self.counts[name] += count
        return True

    def book(self, **operations: int) -> None:
        """Count operations as `charge` does whose time has passed already: not to be taken."""
        before = self.total
        self.charge(**operations)
        self._taken += self.total - before

    def take(self) -> int:
        """Cycles charged since the last call (the first call: since the start)."""
        cycles = self.total - self._taken
        self._taken = self.total
        return cycles

    def phase(self, name: str) -> AbstractContextManager[None]:
        """Book what is charged inside the block under `name`; an inner phase takes its own part."""
        return _Phase(self, name)


class _Phase(AbstractContextManager[None]):
    """A class, as a generator would take a tenth of the time of what it surrounds."""

    __slots__ = ("_meter", "_name", "_outer")

    def __init__(self, meter: Meter, name: str) -> None:
        self._meter, self._name = meter, name

    def __enter__(self) -> None:
        meter = self._meter
        self._outer, meter.phase_now = meter.phase_now, self._name
        meter.phases.setdefault(self._name, 0)

    def __exit__(self, *_: object) -> None:
        self._meter.phase_now = self._outer
