"""An injected fault, the mechanism that performs it, and its log."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from cubestack.emulator.faults.declaration import Fault
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

F = TypeVar("F", bound=Fault)


class FaultEvent(NamedTuple):
    """An effect of a fault, for the log."""

    time_ps: int
    kind: str
    target: str
    text: str

    def __str__(self) -> str:
        return f"{self.time_ps / PS_PER_S:.9f} s {self.kind} {self.target}: {self.text}"


Report = Callable[[int, "Injection", str], None]
"""Called with (time in ps, injection, effect)."""


@dataclass(eq=False)
class Injection:
    """A fault that acts on its target from ``start_ps`` until ``end_ps``."""

    number: int  # counted from 0
    fault: Fault
    target: str
    start_ps: int
    end_ps: int | None  # None: until it is cleared
    seed: int  # seed of its random numbers
    hits: int = 0  # number of effects so far

    @cached_property
    def generator(self) -> np.random.Generator:
        """Random numbers for its effects, in their order."""
        return self.generator_at()

    def active(self, time_ps: int) -> bool:
        return self.start_ps <= time_ps and (self.end_ps is None or time_ps < self.end_ps)

    def generator_at(self, *key: int) -> np.random.Generator:
        """Random numbers that depend on ``key`` alone, not on earlier effects."""
        return np.random.Generator(np.random.PCG64([self.seed, self.number, *key]))

    def has_effect(self, rate: float) -> bool:
        """Draw whether it has an effect, with probability ``rate``."""
        return rate >= 1 or float(self.generator.random()) < rate

    def draw(self, value: int | None, limit: int, *key: int) -> int:
        """``value``, limited below ``limit``; None draws one from ``key``."""
        if value is None:
            return int(self.generator_at(*key).integers(limit))
        return min(value, limit - 1)


@dataclass(eq=False)
class Mechanism:
    """Performs the faults of one target."""

    env: Kernel
    report: Report
    # active ones, and future ones if the mechanism needs them
    injections: list[Injection] = field(default_factory=list, init=False)

    def prepare(self, injection: Injection) -> None:
        """Called when a fault is injected, before it begins; raises ValueError to reject it."""

    def begin(self, injection: Injection) -> None: ...

    def end(self, injection: Injection) -> None:
        if injection in self.injections:
            self.injections.remove(injection)


def active(
    injections: Iterable[Injection], kind: type[F], time_ps: int
) -> list[tuple[Injection, F]]:
    """Those of a kind that are active at ``time_ps``, with their faults."""
    return [
        (injection, injection.fault)
        for injection in injections
        if isinstance(injection.fault, kind) and injection.active(time_ps)
    ]
