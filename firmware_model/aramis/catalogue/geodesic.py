"""The geodesic sphere that divides the sky: an icosahedron split twice, 320 faces.

AraMiS thesis, sections 5.9 and 7.1.3. A direction lies in the face with the nearest centre. The
thesis' figure 5.9 leaves open which faces are adjacent; its ground code counts those with a common
corner, 12, or 11 at the twelve corners of the icosahedron, where only five faces meet. The three
with a common edge would not suffice: they omit stars within the field of view.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Indices, Mask
from cubestack.firmware_model.mcu.costs import Meter

SPLITS = 2
MOST_NEIGHBOURS = 12
NO_FACE = 0xFFFF  #: fills the list of a face with 11 neighbours


@dataclass(frozen=True, eq=False)
class GeodesicSphere:
    """Faces of the sphere, as in flash."""

    centres: Floats  #: (f, 3) unit vectors, float32
    #: (f, 12) faces with a common corner, ascending, filled with `NO_FACE`; uint16
    neighbours: NDArray[np.uint16]

    def __len__(self) -> int:
        return len(self.centres)

    def face_of(self, direction: Floats, meter: Meter) -> int:
        """Face whose centre is nearest to a unit vector (3,)."""
        (x, y, z), along = self.centres.T, direction.astype(np.float32)
        cosine = x * along[0] + y * along[1] + z * along[2]
        count = len(self)
        meter.charge(ram_read=3 * count, f32_mul=3 * count, f32_add=2 * count)
        meter.charge(f32_compare=count, loop=count)
        return int(np.argmax(cosine))

    def around(self, direction: Floats, meter: Meter) -> Mask:
        """Mask (f,) of the face of a unit vector (3,) and of its neighbours."""
        face = self.face_of(direction, meter)
        marked, adjacent = np.zeros(len(self), dtype=bool), self.neighbours[face]
        marked[[face, *adjacent[adjacent != NO_FACE]]] = True
        meter.charge(ram_read=len(adjacent), ram_write=len(self) // 4 + 13, loop=len(adjacent))
        return marked


@lru_cache(maxsize=4)
def geodesic_sphere(splits: int = SPLITS) -> GeodesicSphere:
    """Split each of the icosahedron's 20 faces in four, ``splits`` times (0 to 4)."""
    if not 0 <= splits <= 4:
        raise ValueError(f"splits must be 0 to 4, not {splits}")
    corners, faces = _icosahedron()
    for _ in range(splits):
        corners, faces = _split(corners, faces)
    centres = corners[faces].mean(axis=1)
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    neighbours = np.full((len(faces), MOST_NEIGHBOURS), NO_FACE, dtype=np.uint16)
    shared = np.zeros((len(faces), len(faces)), dtype=bool)
    for corner in range(len(corners)):
        around = np.flatnonzero((faces == corner).any(axis=1))
        shared[np.ix_(around, around)] = True
    np.fill_diagonal(shared, False)
    for face, others in enumerate(shared):
        adjacent = np.flatnonzero(others)
        neighbours[face, : len(adjacent)] = adjacent
    return GeodesicSphere(centres.astype(np.float32), neighbours)


def _icosahedron() -> tuple[NDArray[np.float64], Indices]:
    """Corners (12, 3) of length 1, and faces (20, 3) as indices of corners."""
    golden = (1 + np.sqrt(5)) / 2
    corners = np.array(
        [
            np.roll([0.0, short, long * golden], turn)
            for turn in range(3)
            for short in (-1.0, 1.0)
            for long in (-1.0, 1.0)
        ]
    )
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    edge = np.sort(np.linalg.norm(corners[0] - corners, axis=1))[1] * 1.001
    apart = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    faces = [
        triple
        for triple in combinations(range(12), 3)
        if all(apart[a, b] < edge for a, b in combinations(triple, 2))
    ]
    return corners, np.array(faces, dtype=np.intp)


def _split(corners: NDArray[np.float64], faces: Indices) -> tuple[NDArray[np.float64], Indices]:
    """Four faces from each: its edges are halved and the new corners moved to the sphere."""
    points = [*corners]
    middles: dict[tuple[int, int], int] = {}

    def middle(a: int, b: int) -> int:
        edge = (min(a, b), max(a, b))
        if edge not in middles:
            point = points[a] + points[b]
            middles[edge] = len(points)
            points.append(point / np.linalg.norm(point))
        return middles[edge]

    split = []
    for a, b, c in faces.tolist():
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.array(points), np.array(split, dtype=np.intp)
