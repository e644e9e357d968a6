"""Collects functional coverage over all processes of a regression.

Benches :func:`hit` points in whatever process they run; each process notes its own in a file of the
folder that ``HDL_COVERAGE`` names, or nowhere. :func:`merged` and :func:`table` look at all of them
in the end.
"""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.hdl.coverage.points import GROUPS, Point

_noted: set[tuple[str, Point]] = set()  #: Points that this process noted

_POINTS = {name: frozenset(group.points()) for name, group in GROUPS.items()}


def hit(group: str, **parts: object) -> None:
    """Record a reached point; raises ValueError when it is not declared."""
    names = tuple(GROUPS[group].axes)
    if set(parts) != set(names):
        raise ValueError(f"a point of {group!r} has {', '.join(names)}, not {', '.join(parts)}")
    point = tuple(str(parts[name]) for name in names)
    if point not in _POINTS[group]:
        raise ValueError(f"{' / '.join(point)} is no declared point of {group!r}")
    folder = os.environ.get("HDL_COVERAGE")
    if not folder or (group, point) in _noted:
        return
    _noted.add((group, point))
    with (Path(folder) / f"{os.getpid()}.txt").open("a", encoding="utf-8") as file:
        file.write("\t".join([group, *point]) + "\n")


def merged(folder: Path) -> dict[str, set[Point]]:
    found: dict[str, set[Point]] = {name: set() for name in GROUPS}
    for path in folder.glob("*.txt"):
        for line in path.read_text(encoding="utf-8").splitlines():
            group, *point = line.split("\t")
            found[group].add(tuple(point))
    return found


def missed(found: Mapping[str, set[Point]]) -> list[tuple[str, Point]]:
    return [(name, p) for name, g in GROUPS.items() for p in g.points() if p not in found[name]]


def table(found: Mapping[str, set[Point]], most: int = 40) -> Iterator[str]:
    for name, points in _POINTS.items():
        yield f"{name:<18} {len(found[name]):>5} of {len(points):>5}  {GROUPS[name].meaning}"
    wanting = missed(found)
    for name, point in wanting[:most]:
        parts = zip(GROUPS[name].axes, point, strict=True)
        yield f"not reached: {name}: {', '.join(f'{axis} {part!r}' for axis, part in parts)}"
    if len(wanting) > most:
        yield f"not reached: {len(wanting) - most} more"
