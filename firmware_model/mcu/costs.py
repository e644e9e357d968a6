"""Cycle costs of a processor's operations, and the meter that adds them up.

An algorithm charges the operations that its program would have executed, as often as they really
happened; the table of its part (a module beside this one) converts the counts to cycles.
"""

from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

Provenance = Literal["measured", "published", "fitted", "assumed"]


class CostError(ValueError):
    """An invalid cost, table or charge; the message names it."""


@dataclass(frozen=True)
class Cost:
    """Processor cycles of one operation, and their source."""

    cycles: int
    provenance: Provenance
    source: str

    def __post_init__(self) -> None:
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
        return {name: cost.cycles for name, cost in self.operations.items()}

    def seconds(self, cycles: int) -> float:
        return cycles / self.clock_hz


@dataclass(eq=False)
class Meter:
    """Counts a program's operations by name, and its cycles: in total and per phase.

    Attributes:
        table: of the processor.
        total, counts, phases: cycles in all, operations by name, cycles by phase.
        current_phase: of the innermost block; set by ``phase``.
    """

    table: CostTable
    total: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    phases: dict[str, int] = field(default_factory=dict)
    _taken: int = 0
    current_phase: str | None = None

    def charge(self, **operations: int) -> None:
        """Charge each named operation with its count.

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
        if self.current_phase is not None:
            self.phases[self.current_phase] += cycles

    def charge_all(self, phases: Mapping[str, Mapping[str, int]], limit: int) -> bool:
        """Charge by phase unless the total would exceed ``limit``; returns whether it charged.

        Equivalent to `phase` and `charge` one by one, in half of the model's time.

        Raises:
            KeyError: for an operation that the table does not have.
        """
        table = self.table.cycles
        taken = {
            phase: sum([table[name] * count for name, count in operations.items()])
            for phase, operations in phases.items()
        }
        counts: dict[str, int] = {}
        for operations in phases.values():
            for name, count in operations.items():
                counts[name] = counts.get(name, 0) + count
        return self.charge_sums(taken, counts, limit)

    def charge_sums(self, phases: Mapping[str, int], counts: Mapping[str, int], limit: int) -> bool:
        """Charge cycles of phases and their operations by name, as ``charge_all`` does."""
        total = self.total + sum(phases.values())
        if total > limit:
            return False
        self.total = total
        for phase, cycles in phases.items():
            self.phases[phase] = self.phases.get(phase, 0) + cycles
        for name, count in counts.items():
            self.counts[name] += count
        return True

    def charge_elapsed(self, **operations: int) -> None:
        """Count operations like `charge`; their time has elapsed, so `take` excludes it."""
        before = self.total
        self.charge(**operations)
        self._taken += self.total - before

    def take(self) -> int:
        """Cycles charged since the last call (the first call: since the start)."""
        cycles = self.total - self._taken
        self._taken = self.total
        return cycles

    def phase(self, name: str) -> AbstractContextManager[None]:
        """Charge the block's operations to the phase `name`; an inner phase has its own part."""
        return _Phase(self, name)


class _Phase(AbstractContextManager[None]):
    """A class, because a generator would take a tenth of the time of what it surrounds."""

    __slots__ = ("_meter", "_name", "_outer")

    def __init__(self, meter: Meter, name: str) -> None:
        self._meter, self._name = meter, name

    def __enter__(self) -> None:
        meter = self._meter
        self._outer, meter.current_phase = meter.current_phase, self._name
        meter.phases.setdefault(self._name, 0)

    def __exit__(self, *_: object) -> None:
        self._meter.current_phase = self._outer
