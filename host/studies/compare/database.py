"""The lists that the methods store: pairs of stars by angle, and triangles.

Both come from the tracker's star list and its longest angle, and are built on first use. Angles are
stored as 32-bit floats, stars as 16-bit indices; a k-vector of 32-bit starts has a quarter as many
entries as its list (Mortari's search; AraMiS thesis, section 5.3).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.quadtree import pairs
from cubestack.host.studies.compare.tracker import Floats, Indices, Tracker

FLOAT, INDEX, START = 4, 2, 4  #: bytes
VALUES_PER_START = 4
BIN_STEPS = 8  #: entries beside the range that the bins of its two ends hold, on average


def index_bytes(entries: int) -> int:
    return entries // VALUES_PER_START * START


def charge_lookup(found: int, meter: Meter, words: int = 2) -> None:
    """A range of a sorted list by its k-vector, and ``words`` of each of its entries."""
    meter.charge(f32_add=4, f32_mul=2, f32_convert=2, f32_compare=BIN_STEPS, loop=BIN_STEPS + found)
    meter.charge(flash_read=2 + BIN_STEPS + words * found)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of stars by angle."""

    first: Indices  #: (p,) one star of each
    second: Indices  #: (p,) the other one
    angle: Floats  #: (p,) in rad, rising
    looked_at: int  #: stars that the quadtree looked at to find them

    def within(self, angle: float, margin: float, meter: Meter) -> tuple[Indices, Indices]:
        """Both stars (k,) of the pairs whose angle is within a margin of one."""
        start, stop = self.angle.searchsorted(np.array([angle - margin, angle + margin]))
        charge_lookup(stop - start, meter)
        return self.first[start:stop], self.second[start:stop]

    @property
    def bytes(self) -> int:
        entries = len(self.angle)
        return entries * (2 * INDEX + FLOAT) + index_bytes(entries)


@dataclass(frozen=True, eq=False)
class Catalogue:
    """The star list of a tracker and what is made of it."""

    tracker: Tracker

    @cached_property
    def vectors(self) -> NDArray[np.float64]:
        """(m, 3) as stored, in double precision for the sums of this study."""
        return self.tracker.stars.astype(np.float64)

    @property
    def star_bytes(self) -> int:
        return len(self.vectors) * 3 * FLOAT

    @cached_property
    def pairs(self) -> Pairs:
        first, second, looked_at = pairs(self.vectors, self.tracker.pair_limit_rad)
        angle = angles(self.vectors[first], self.vectors[second]).astype(np.float32)
        order = np.argsort(angle, kind="stable")
        return Pairs(first[order], second[order], angle[order], looked_at)

    @cached_property
    def triangles(self) -> Indices:
        """(t, 3) stars of each triangle with sides up to the limit, ascending indices."""
        near = np.zeros((len(self.vectors),) * 2, bool)
        near[self.pairs.first, self.pairs.second] = True
        near |= near.T
        found = []
        for first in range(len(near)):
            others = first + 1 + np.flatnonzero(near[first, first + 1 :])
            second, third = np.nonzero(np.triu(near[np.ix_(others, others)], 1))
            alike = np.full(len(second), first)
            found.append(np.stack([alike, others[second], others[third]], axis=1))
        return np.concatenate(found)


def angles(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles in rad between unit vectors (..., 3), exact for small ones too."""
    chord = np.linalg.norm(one - other, axis=-1)
    found: NDArray[np.float64] = 2 * np.arcsin(np.minimum(chord / 2, 1))
    return found


class MeasuredAngles:
    """Angles between an image's stars, each computed once and charged when it is first used."""

    def __init__(self, rays: Floats, meter: Meter) -> None:
        exact = rays.astype(np.float64)
        self.all = angles(exact[:, None], exact[None])  #: (n, n) in rad; not charged
        self._meter, self._known = meter, np.eye(len(rays), dtype=bool)

    def __call__(self, one: int, other: int) -> float:
        if not self._known[one, other]:
            self._known[one, other] = self._known[other, one] = True
            charge_angles(1, self._meter)
        return float(self.all[one, other])


def charge_angles(count: int, meter: Meter) -> None:
    """Scalar product and arc cosine, the CubeStar thesis' equation 4.3.1."""
    meter.charge(f32_mul=3 * count, f32_add=2 * count, f32_acos=count, ram_read=6 * count)
    meter.charge(ram_write=count, loop=count)
