"""Functional coverage: declared points, and which of them testbenches reach.

A :class:`Group` is a table of points, one for each combination of its axes that can happen.
Testbenches :meth:`Coverage.hit` points in whatever process they run; each process notes its own in
a file of the folder that ``HDL_COVERAGE`` names, or nowhere.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path

Point = tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """Points of one kind; ``meaning`` is what a point is.

    ``axes`` are the names of its parts, and what each can be; ``possible`` returns whether a
    combination, given by these names, can happen at all.
    """

    meaning: str
    axes: Mapping[str, Iterable[object]]
    possible: Callable[..., bool] = lambda **_: True

    def points(self) -> list[Point]:
        return [
            tuple(map(str, parts))
            for parts in product(*self.axes.values())
            if self.possible(**dict(zip(self.axes, parts, strict=True)))
        ]


class Coverage:
    """Groups by name, and the points that this process noted."""

    def __init__(self, groups: Mapping[str, Group]) -> None:
        self.groups = groups
        self._noted: set[tuple[str, Point]] = set()
        self._points = {name: frozenset(group.points()) for name, group in groups.items()}

    def hit(self, group: str, **parts: object) -> None:
        """Record a reached point; raises ValueError when it is not declared."""
        names = tuple(self.groups[group].axes)
        if set(parts) != set(names):
            raise ValueError(f"a point of {group!r} has {', '.join(names)}, not {', '.join(parts)}")
        point = tuple(str(parts[name]) for name in names)
        if point not in self._points[group]:
            raise ValueError(f"{' / '.join(point)} is no declared point of {group!r}")
        folder = os.environ.get("HDL_COVERAGE")
        if not folder or (group, point) in self._noted:
            return
        self._noted.add((group, point))
        with (Path(folder) / f"{os.getpid()}.txt").open("a", encoding="utf-8") as file:
            file.write("\t".join([group, *point]) + "\n")

    def forget(self) -> None:
        """Note points again that this process noted before."""
        self._noted.clear()

    def merged(self, folder: Path) -> dict[str, set[Point]]:
        found: dict[str, set[Point]] = {name: set() for name in self.groups}
        for path in folder.glob("*.txt"):
            for line in path.read_text(encoding="utf-8").splitlines():
                group, *point = line.split("\t")
                found[group].add(tuple(point))
        return found

    def missed(self, found: Mapping[str, set[Point]]) -> list[tuple[str, Point]]:
        return [
            (name, point)
            for name, group in self.groups.items()
            for point in group.points()
            if point not in found[name]
        ]

    def table(self, found: Mapping[str, set[Point]], most: int = 40) -> Iterator[str]:
        for name, points in self._points.items():
            meaning = self.groups[name].meaning
            yield f"{name:<18} {len(found[name]):>5} of {len(points):>5}  {meaning}"
        wanting = self.missed(found)
        for name, point in wanting[:most]:
            parts = zip(self.groups[name].axes, point, strict=True)
            yield f"not reached: {name}: {', '.join(f'{axis} {part!r}' for axis, part in parts)}"
        if len(wanting) > most:
            yield f"not reached: {len(wanting) - most} more"
