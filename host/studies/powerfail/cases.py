"""The cases of a scenario: when the supply is cut, and in which way."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count

from cubestack.emulator.iss.flash_changes import FlashOperation
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.rig import seeded
from cubestack.host.studies.powerfail.scenario import Scenario

BEFORE, TORN, AFTER, BETWEEN = "before", "torn", "after", "between"
WORN, BROWN_OUT = "worn", "brown-out"
KINDS = BEFORE, TORN, AFTER, BETWEEN, BROWN_OUT, WORN

PLACES, SECONDS = 2, 3
"""Mark random numbers of moments between operations, and of second cuts."""


@dataclass(frozen=True)
class Cut:
    """An operation that a cut ends.

    ``operation`` is an index: those before it are complete. ``share`` of its duration is done;
    None if it has not begun.
    """

    operation: int
    share: float | None = None


@dataclass(frozen=True)
class Case:
    """What happens to the device.

    Attributes:
        number: of the case, from 0.
        kind: one of ``KINDS``.
        cut: state of the flash; for ``WORN``, the erasure from which on the page is worn.
        time_ps: moment of the cut.
        curve: index of the brown-out.
    """

    number: int
    kind: str
    cut: Cut
    time_ps: int
    curve: int = 0


@dataclass(frozen=True)
class SecondCut:
    """A cut during the recovery from a case."""

    number: int  #: among all of the case
    cut: Cut  #: of the operations of the recovery
    time_ps: int  #: since the power-up


def shares(torn: int) -> list[float]:
    """Shares of the duration of an operation at which it is cut."""
    return [(index + 0.5) / torn for index in range(torn)]


def cases_of(scenario: Scenario, course: Course) -> list[Case]:
    """All cases; each has the same number in every run."""
    numbers = count()
    return [
        Case(next(numbers), *one)
        for part in (_cuts, _brown_outs, _worn)
        for one in part(scenario, course)
    ]


def _cuts(scenario: Scenario, course: Course) -> Iterator[tuple[str, Cut, int]]:
    yield from _between(scenario, course, 0)
    for place, one in enumerate(course.operations):
        yield BEFORE, Cut(place), one.time_ps
        for share in shares(scenario.torn):
            yield TORN, Cut(place, share), _moment(one, share)
        yield AFTER, Cut(place + 1), one.end_ps
        yield from _between(scenario, course, place + 1)


def _between(scenario: Scenario, course: Course, place: int) -> Iterator[tuple[str, Cut, int]]:
    """Cuts after ``place`` operations, at moments drawn evenly up to the next operation."""
    start = course.operations[place - 1].end_ps if place else 0
    whole = place == len(course.operations)
    end = course.end_ps if whole else course.operations[place].time_ps
    if end > start:
        drawn = seeded(scenario.seed, PLACES, place).integers(start, end, scenario.between)
        for time_ps in sorted(map(int, drawn)):
            yield BETWEEN, Cut(place), time_ps


def _brown_outs(scenario: Scenario, course: Course) -> Iterator[tuple[str, Cut, int, int]]:
    for curve in range(len(scenario.brown_out)):
        for place, one in enumerate(course.operations):
            yield BROWN_OUT, Cut(place, 0.5), _moment(one, 0.5), curve


def _worn(scenario: Scenario, course: Course) -> Iterator[tuple[str, Cut, int]]:
    for place, one in enumerate(course.operations):
        if one.erases:
            for _ in range(scenario.worn):
                yield WORN, Cut(place), one.time_ps


def every_second_cut(scenario: Scenario, recovery: Sequence[FlashOperation]) -> list[SecondCut]:
    """Cuts in and after each operation of a recovery."""
    found = list[tuple[Cut, int]]()
    for place, one in enumerate(recovery):
        found += [(Cut(place, share), _moment(one, share)) for share in shares(scenario.torn)]
        found.append((Cut(place + 1), one.end_ps))
    return [SecondCut(number, *one) for number, one in enumerate(found)]


def second_cuts(
    scenario: Scenario, case: Case, recovery: Sequence[FlashOperation]
) -> list[SecondCut]:
    """Second cuts of a case; a random choice if there are more than the scenario wants."""
    every = every_second_cut(scenario, recovery)
    if len(every) <= scenario.second:
        return every
    rng = seeded(scenario.seed, SECONDS, case.number)
    return [every[one] for one in sorted(rng.choice(len(every), scenario.second, replace=False))]


def _moment(one: FlashOperation, share: float) -> int:
    return one.time_ps + round(share * (one.end_ps - one.time_ps))
