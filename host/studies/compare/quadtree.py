"""Pairs of stars closer than a limit, by a spherical quadtree.

AraMiS thesis, section 5.3: the tree finds the stars of a region without looking at all others. Its
faces are those of an octahedron, each divided into four until few stars are in it. It runs on the
ground, where the list of pairs is compiled; the part has the list alone.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cubestack.host.studies.compare.tracker import Indices

Vectors = NDArray[np.float64]

MOST_STARS = 8
DEEPEST = 10
_UP, _DOWN = np.array([0.0, 0, 1]), np.array([0.0, 0, -1])
_ROUND = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])


@dataclass(eq=False)
class Face:
    """A triangle of the sphere: its stars, or four smaller ones."""

    centre: Vectors
    radius_rad: float  #: from the centre to the farthest corner
    stars: Indices
    parts: list["Face"] = field(default_factory=list)


def build(vectors: Vectors) -> list[Face]:
    """The eight trees of unit vectors (n, 3)."""
    corners = [
        np.stack([pole, _ROUND[side], _ROUND[(side + 1) % 4]])
        for pole in (_UP, _DOWN)
        for side in range(4)
    ]
    nearest = np.argmax(vectors @ np.stack([c.sum(axis=0) for c in corners]).T, axis=1)
    return [_divided(vectors, c, np.flatnonzero(nearest == k), 0) for k, c in enumerate(corners)]


def _divided(vectors: Vectors, corners: Vectors, stars: Indices, depth: int) -> Face:
    centre = corners.sum(axis=0) / np.linalg.norm(corners.sum(axis=0))
    face = Face(centre, float(np.arccos((corners @ centre).min())), stars)
    if len(stars) <= MOST_STARS or depth == DEEPEST:
        return face
    a, b, c = corners
    ab, bc, ca = (side / np.linalg.norm(side) for side in (a + b, b + c, c + a))
    parts = [np.stack(part) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    # A star is in the part on whose side of the three arcs between the middles it is.
    inward = np.stack([np.cross(ca, ab), np.cross(ab, bc), np.cross(bc, ca)])
    inward *= np.sign(inward @ centre)[:, None]
    outside = vectors[stars] @ inward.T < 0
    which = np.where(outside.any(axis=1), outside.argmax(axis=1), 3)
    face.parts = [
        _divided(vectors, part, stars[which == k], depth + 1) for k, part in enumerate(parts)
    ]
    return face


def near(tree: list[Face], vectors: Vectors, to: Vectors, limit_rad: float) -> tuple[Indices, int]:
    """Stars closer than a limit to a direction (3,), ascending; and how many were looked at."""
    found, todo, looked_at = list[Indices](), list(tree), 0
    while todo:
        face = todo.pop()
        apart = float(np.arccos(np.clip(face.centre @ to, -1, 1)))
        if not len(face.stars) or apart > face.radius_rad + limit_rad:
            continue
        if face.parts and apart + face.radius_rad >= limit_rad:
            todo += face.parts
            continue
        found.append(face.stars)
        looked_at += len(face.stars)
    stars = np.sort(np.concatenate([np.zeros(0, np.intp), *found]))
    chords = np.linalg.norm(vectors[stars] - to, axis=1)
    return stars[2 * np.arcsin(np.minimum(chords / 2, 1)) < limit_rad], looked_at


def pairs(vectors: Vectors, limit_rad: float) -> tuple[Indices, Indices, int]:
    """First and second star of each pair, ascending, and how many stars were looked at."""
    tree, looked_at = build(vectors), 0
    firsts, seconds = list[Indices](), list[Indices]()
    for star, vector in enumerate(vectors):
        others, looked = near(tree, vectors, vector, limit_rad)
        others = others[others > star]
        firsts.append(np.full(len(others), star))
        seconds.append(others)
        looked_at += looked
    return np.concatenate(firsts), np.concatenate(seconds), looked_at
