"""A fault that was injected, what carries it out, and the log."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from cubestack.emulator.faults.declaration import Fault
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

F = TypeVar("F", bound=Fault)


class FaultEvent(NamedTuple):
    """Something that a fault did."""

    time_ps: int
    kind: str
    target: str
    text: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.time_ps / PS_PER_S:.9f} s {self.kind} {self.target}: {self.text}"


Report = Callable[[int, "Injection", str], None]
"""Called with (time in ps, injection, what happened)."""


@dataclass(eq=False)
class Injection:
    """A fault at its target.

    Attributes:
        number: of the injection, from 0.
        fault: what happens.
        target: where.
        start_ps: when it begins.
        end_ps: when it is over; None for never.
        seed: of everything random about it.
        hits: how often it did something.
    """

    number: int
    fault: Fault
    target: str
    start_ps: int
    end_ps: int | None
    seed: int
    hits: int = 0

    @cached_property
    def generator(self) -> np.random.Generator:
        """Random numbers in the order of what it does."""
        return self.generator_at()

    def active(self, time_ps: int) -> bool:
        """Whether it acts at that time."""
        return self.start_ps <= time_ps and (self.end_ps is None or time_ps < self.end_ps)

    def generator_at(self, *key: int) -> np.random.Generator:
        """Random numbers that depend on ``key`` alone, whatever came before."""
        return np.random.Generator(np.random.PCG64([self.seed, self.number, *key]))

    def strikes(self, rate: float) -> bool:
        """Draw whether it hits, with probability ``rate``."""
        return rate >= 1 or float(self.generator.random()) < rate

    def drawn(self, value: int | None, limit: int, *key: int) -> int:
        """``value``, below ``limit``; None draws one from ``key``."""
        if value is None:
            return int(self.generator_at(*key).integers(limit))
        return min(value, limit - 1)


@dataclass(eq=False)
class Mechanism:
    """What carries out the faults of one target.

    Attributes:
        env: virtual time.
        report: told what a fault did.
        injections: that act, and those ahead where that is to be known.
    """

    env: Kernel
    report: Report
    injections: list[Injection] = field(default_factory=list, init=False)

    def prepare(self, injection: Injection) -> None:
        """Know of a fault ahead, or refuse it: ValueError."""

    def begin(self, injection: Injection) -> None:
        """Act from now on."""

    def end(self, injection: Injection) -> None:
        """Act no longer."""
        if injection in self.injections:
            self.injections.remove(injection)


def active(
    injections: Iterable[Injection], kind: type[F], time_ps: int
) -> list[tuple[Injection, F]]:
    """Those of a kind that act at that time, with their faults."""
    return [
        (injection, injection.fault)
        for injection in injections
        if isinstance(injection.fault, kind) and injection.active(time_ps)
    ]
