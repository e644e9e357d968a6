"""Statistics of a campaign: rates, errors, and differences to another campaign."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import comb
from typing import Any

from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder, FolderError

ENDINGS = ("right", "refused", "wrong", "failed")

ERROR = "error"
"""Prefix of error names in results."""

SIGNIFICANCE = 0.01
"""Probability of a false change in a comparison, over all its lines."""

Point = tuple[tuple[str, Any], ...]


def point_of(row: Row, names: Iterable[str]) -> Point:
    values = ((name, row.swept[name]) for name in names)
    return tuple((name, tuple(v) if isinstance(v, list) else v) for name, v in values)


def told(point: Point) -> str:
    """Text of a point; "all" without a grid."""
    return ", ".join(f"{name} = {value}" for name, value in point) or "all"


def rates(folder: Folder) -> dict[Point, Counter[str]]:
    """Number of rows of each outcome, by point of the grid."""
    found: dict[Point, Counter[str]] = {}
    for row in folder.rows():
        found.setdefault(point_of(row, folder.plan.grid), Counter())[row.outcome] += 1
    return found


def errors(folder: Folder) -> dict[str, dict[Point, list[float]]]:
    """Sorted error sizes of the solved rows, by name and point of the grid."""
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
    """Change of an outcome at a point in another campaign of the same skies."""

    #: point, outcome: of the rows
    point: Point
    outcome: str
    #: before, after: number of rows with it
    before: int
    after: int
    #: lost, gained: rows with it only in the first, and only in the other campaign
    lost: int
    gained: int
    chance: float  #: probability of such unequal numbers if nothing changed
    significant: bool  #: less than `SIGNIFICANCE` by the number of lines

    @property
    def worse(self) -> bool:
        """Whether significantly fewer are right, or more wrong or failed."""
        fewer = self.after < self.before
        return self.significant and (fewer if self.outcome == "right" else not fewer)


def compared(first: Folder, other: Folder) -> list[Change]:
    """Changes of right, wrong and failed rows.

    It is McNemar's exact test: without a change, rows change equally often either way.

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
    """Two-sided binomial probability of numbers at least this unequal."""
    of = one + other
    tail = sum(comb(of, number) for number in range(min(one, other) + 1))
    return min(1.0, 2 * tail / (1 << of))
