"""What the rows of a campaign say together: rates, errors, and whether another campaign differs."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import comb
from typing import Any

from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder, FolderError

ENDINGS = ("right", "refused", "wrong", "failed")

ERROR = "error"
"""What the names of errors begin with, in results."""

SIGNIFICANCE = 0.01
"""Probability that a comparison tells a change where there is none, over all of its lines."""

Point = tuple[tuple[str, Any], ...]


def point_of(row: Row, names: Iterable[str]) -> Point:
    """Where a row stands in the grid: names and values."""
    values = ((name, row.swept[name]) for name in names)
    return tuple((name, tuple(v) if isinstance(v, list) else v) for name, v in values)


def told(point: Point) -> str:
    """A point as a reader has it; all of a campaign without a grid."""
    return ", ".join(f"{name} = {value}" for name, value in point) or "all"


def rates(folder: Folder) -> dict[Point, Counter[str]]:
    """How many rows ended how, by point of the grid."""
    found: dict[Point, Counter[str]] = {}
    for row in folder.rows():
        found.setdefault(point_of(row, folder.plan.grid), Counter())[row.outcome] += 1
    return found


def errors(folder: Folder) -> dict[str, dict[Point, list[float]]]:
    """Sizes of errors of what is not refused, rising, by their name and point of the grid."""
    found: dict[str, dict[Point, list[float]]] = {}
    measured = (row for row in folder.rows() if row.outcome in ("right", "wrong"))
    for row in measured:
        point = point_of(row, folder.plan.grid)
        for name, value in row.result.items():
            if name.startswith(ERROR) and isinstance(value, int | float):
                found.setdefault(name, {}).setdefault(point, []).append(abs(value))
    return {
        name: {point: sorted(values) for point, values in points.items()}
        for name, points in found.items()
    }


@dataclass(frozen=True)
class Change:
    """What another campaign has of an outcome at a point, on the same skies.

    Attributes:
        point, outcome: of the rows.
        before, after: how many have it.
        lost, gained: rows that only the first, and only the other one has.
        chance: probability of so unequal numbers, or more so, if nothing changed.
        significant: less than `SIGNIFICANCE` by the number of lines.
    """

    point: Point
    outcome: str
    before: int
    after: int
    lost: int
    gained: int
    chance: float
    significant: bool

    @property
    def worse(self) -> bool:
        """Significantly fewer right, or more wrong or failed."""
        fewer = self.after < self.before
        return self.significant and (fewer if self.outcome == "right" else not fewer)


def compared(first: Folder, other: Folder) -> list[Change]:
    """Changes of what is right, wrong or failed, row by row.

    The test is McNemar's, exact: of the rows that changed, as many should have changed either way.

    Raises:
        FolderError: they have not the same skies.
    """
    twins = {row.key: row for row in other.rows()}
    rows = list(first.rows())
    if first.plan.grid != other.plan.grid or {row.key for row in rows} != twins.keys():
        raise FolderError(f"{other.path} and {first.path} have not the same grid and as many rows")
    pairs = [(row, twins[row.key]) for row in rows]
    for row, twin in pairs:
        same = (row.seed, row.after, row.swept) == (twin.seed, twin.after, twin.swept)
        if not same and "failed" not in (row.outcome, twin.outcome):
            raise FolderError(f"{other.path} has other skies than {first.path}: another seed")
    counted: dict[tuple[Point, str], Counter[tuple[bool, bool]]] = {}
    for row, twin in pairs:
        for outcome in ("right", "wrong", "failed"):
            key = point_of(row, first.plan.grid), outcome
            has = (row.outcome == outcome, twin.outcome == outcome)
            counted.setdefault(key, Counter())[has] += 1
    return [
        _change(point, outcome, found, len(counted)) for (point, outcome), found in counted.items()
    ]


def _change(
    point: Point, outcome: str, found: Mapping[tuple[bool, bool], int], lines: int
) -> Change:
    both, lost, gained = found[True, True], found[True, False], found[False, True]
    chance = by_chance(lost, gained)
    return Change(
        *(point, outcome, both + lost, both + gained, lost, gained),
        chance,
        chance < SIGNIFICANCE / lines,
    )


def by_chance(one: int, other: int) -> float:
    """Probability that so many coins fall so unequally, or more so."""
    of = one + other
    tail = sum(comb(of, number) for number in range(min(one, other) + 1))
    return min(1.0, 2 * tail / (1 << of))
