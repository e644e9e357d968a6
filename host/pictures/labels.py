"""Where the labels of marks go: beside their marks, and never over one another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot

GAP_PX = 3.0
"""Between a mark and its label."""

RINGS = (1.0, 2.2)
"""Distances that are tried, in sizes of the mark and its gap."""


@dataclass(frozen=True)
class Box:
    """A rectangle in pixels; edges that touch do not overlap."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: "Box") -> bool:
        return (
            self.left < other.right
            and other.left < self.right
            and self.top < other.bottom
            and other.top < self.bottom
        )

    def within(self, other: "Box") -> bool:
        return (
            other.left <= self.left
            and other.top <= self.top
            and self.right <= other.right
            and self.bottom <= other.bottom
        )


@dataclass(frozen=True)
class Wanted:
    """A label: the middle of its mark, that one's radius, and the text's size, all px."""

    x: float
    y: float
    radius: float
    width: float
    height: float


def place(wanted: Sequence[Wanted], frame: Box, obstacles: Sequence[Box] = ()) -> list[Box | None]:
    """Boxes of labels in order, the first ones first; None where there is no room.

    Greedy: each takes the first free place around its mark that is nearer to it than to the other
    marks, right of it before all others; where there is none, the first free one. No box overlaps
    another one or an obstacle, and each is in the ``frame`` whole.
    """
    taken = list(obstacles)
    placed: list[Box | None] = []
    for label in wanted:
        free = [
            box
            for box in _candidates(label)
            if box.within(frame) and not any(box.overlaps(other) for other in taken)
        ]
        own = (
            box
            for box in free
            if all(distance(box, label) <= distance(box, other) for other in wanted)
        )
        chosen = next(own, next(iter(free), None))
        placed.append(chosen)
        if chosen is not None:
            taken.append(chosen)
    return placed


def distance(box: Box, label: Wanted) -> float:
    """From a box to the middle of a label's mark, px; 0 within it."""
    across = max(box.left - label.x, label.x - box.right, 0.0)
    down = max(box.top - label.y, label.y - box.bottom, 0.0)
    return hypot(across, down)


def _candidates(label: Wanted) -> Iterator[Box]:
    for ring in RINGS:
        across = ring * (label.radius + GAP_PX)
        down = across / 2 + label.height / 2
        right, left = label.x + across, label.x - across - label.width
        middle = label.x - label.width / 2
        above, below = label.y - across - label.height, label.y + across
        level = label.y - label.height / 2
        for x, y in (
            (right, level),
            (left, level),
            (right, level - down),
            (right, level + down),
            (middle, above),
            (middle, below),
            (left, level - down),
            (left, level + down),
        ):
            yield Box(x, y, x + label.width, y + label.height)
