"""The star catalogue in CubeStar's flash: a star list and a list of star pairs.

CubeStar thesis, sections 4.3.2 (Algorithm 1), 4.3.4 (reduced catalogue) and 5.3.2 (constant arrays
in flash: 405 stars in 5.54 kB, 11 484 pairs in 89.7 kB). Two pairs are closer than the camera can
resolve; like the thesis, this list keeps them. An extension: a companion within `COMPANION_RAD` of
a brighter star is left out, because the two would tie in every vote. With Hipparcos and V below 3.8
that is only alpha Centauri B, without which the published 405 stars remain. Magnitudes and
Hipparcos numbers are not in flash (the published size leaves no room): they are kept here for the
ground's reports.
"""

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

#: Angle in rad, half a pixel, below which the fainter of two stars is omitted. Chosen: it leaves
#: the published 405 stars, and the published two closest pairs.
COMPANION_RAD = 0.0005


class CatalogueError(ValueError):
    """Arrays or limits that allow no catalogue."""


@dataclass(frozen=True, eq=False)
class PairList:
    """Pairs of stars, sorted by ascending angle."""

    first: NDArray[np.uint16]  #: (m,) index of one star in the star list
    second: NDArray[np.uint16]  #: (m,) index of the other star
    angle: NDArray[np.float32]  #: (m,) angle between them in rad, single precision, ascending

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """Second and first stars (2, m) as indices; for the model's speed."""
        return np.stack((self.second, self.first)).astype(np.intp)

    def __len__(self) -> int:
        return len(self.angle)


@dataclass(frozen=True, eq=False)
class StarCatalogue:
    """Star list and pair list for one magnitude limit, pair limit and epoch."""

    vectors: NDArray[np.float32]  #: (n, 3) inertial unit vectors, single precision as stored
    pairs: PairList  #: every pair closer than the pair limit
    hip: NDArray[np.int64]  #: (n,) Hipparcos numbers, for the ground
    v_mag: NDArray[np.float64]  #: (n,) V magnitudes, for the ground
    mag_limit: float  #: stars are strictly brighter than this V magnitude
    pair_limit_deg: float  #: pairs are strictly closer than this angle

    @cached_property
    def cosines(self) -> NDArray[np.float32]:
        """Cosines (n, n) of the angles between stars, for the model's speed; the part has none."""
        return np.asarray(sum(np.outer(axis, axis) for axis in self.vectors.T), np.float32)

    @cached_property
    def _axes(self) -> NDArray[np.float32]:
        """The vectors by axis (3, n), as in the part."""
        return np.ascontiguousarray(self.vectors.T)

    @classmethod
    def build(
        cls,
        hip: NDArray[np.integer[Any]],
        unit_vectors: NDArray[np.float64],
        v_mag: NDArray[np.float64],
        mag_limit: float,
        pair_limit_deg: float,
    ) -> Self:
        """Select the stars, sort them by Hipparcos number and list their pairs.

        Args:
            hip: (n,) distinct Hipparcos numbers, any order.
            unit_vectors: (n, 3) directions at the wanted epoch.
            v_mag: (n,) V magnitudes.
            mag_limit: V magnitude below which a star is selected.
            pair_limit_deg: angle in degrees, 0 to 180, below which a pair is listed.

        Raises:
            CatalogueError: for inconsistent shapes, vectors of another length than 1, or limits
                that leave fewer than two stars or more than a 16-bit index can number.
        """
        count = len(hip)
        if unit_vectors.shape != (count, 3) or v_mag.shape != (count,):
            raise CatalogueError(
                f"{count} stars need vectors of shape ({count}, 3) and magnitudes of shape "
                f"({count},), not {unit_vectors.shape} and {v_mag.shape}"
            )
        if not np.allclose(np.einsum("ij,ij->i", unit_vectors, unit_vectors), 1.0, atol=1e-6):
            raise CatalogueError("unit_vectors must have length 1")
        if not 0.0 < pair_limit_deg <= 180.0:
            raise CatalogueError(f"pair_limit_deg must lie in 0 to 180, not {pair_limit_deg}")
        taken = np.flatnonzero(v_mag < mag_limit)
        if not 2 <= len(taken) <= 65_535:
            raise CatalogueError(
                f"magnitude limit {mag_limit} leaves {len(taken)} stars, not 2 to 65 535"
            )
        taken = taken[np.argsort(hip[taken], kind="stable")]
        taken = taken[~_companions(unit_vectors[taken], v_mag[taken])]
        return cls(
            vectors=unit_vectors[taken].astype(np.float32),
            pairs=_list_pairs(unit_vectors[taken], np.radians(pair_limit_deg)),
            hip=hip[taken].astype(np.int64),
            v_mag=v_mag[taken].astype(np.float64),
            mag_limit=mag_limit,
            pair_limit_deg=pair_limit_deg,
        )

    def __len__(self) -> int:
        return len(self.vectors)

    @property
    def star_bytes(self) -> int:
        """Flash for the star list: a 16-bit name and three floats per star."""
        return len(self) * (2 + 3 * 4)

    @property
    def pair_bytes(self) -> int:
        """Flash for the pair list: two 16-bit names and a float per pair."""
        return len(self.pairs) * (2 + 2 + 4)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The seven constant arrays by name, in order, little-endian.

        Names, x, y and z of the stars; first name, second name and angle in rad of the pairs.
        """
        x, y, z = self.vectors.T.astype("<f4")
        return {
            "star": np.arange(len(self), dtype="<u2"),
            "star_x": x,
            "star_y": y,
            "star_z": z,
            "pair_first": self.pairs.first.astype("<u2"),
            "pair_second": self.pairs.second.astype("<u2"),
            "pair_angle": self.pairs.angle.astype("<f4"),
        }

    def to_bytes(self) -> bytes:
        return b"".join(array.tobytes() for array in self.arrays().values())

    def sha256(self) -> str:
        return hashlib.sha256(self.to_bytes()).hexdigest()

    def with_pair_limit(self, pair_limit_deg: float) -> "StarCatalogue":
        """This catalogue with a narrower pair list: the beginning of its own, which is sorted."""
        return _narrowed(self, pair_limit_deg)

    def near(
        self, boresight: NDArray[np.float32], radius_deg: float, meter: Meter
    ) -> NDArray[np.uint16]:
        """Indices of the stars within `radius_deg` of a unit vector (3,), ascending."""
        least = np.float32(np.cos(np.radians(radius_deg)))
        return self.within(boresight, least, meter).astype(np.uint16)

    def within(
        self, boresight: NDArray[np.float32], least: np.float32, meter: Meter
    ) -> NDArray[np.intp]:
        """Ascending indices of the stars whose cosine with a unit vector is ``least`` or more."""
        direction = boresight.astype(np.float32)
        x, y, z = self._axes
        cosine = x * direction[0] + y * direction[1] + z * direction[2]
        inside: NDArray[np.intp] = (cosine >= least).nonzero()[0]
        count = len(self)
        meter.charge(
            flash_read=3 * count,
            f32_mul=3 * count,
            f32_add=2 * count,
            f32_compare=count,
            ram_write=count,
            loop=count,
        )
        return inside

    def reduced(
        self, boresight: NDArray[np.float32], radius_deg: float, meter: Meter
    ) -> tuple[NDArray[np.uint16], PairList]:
        """The stars within `radius_deg` of a unit vector (3,), as from `near`, and their pairs.

        One pass over the star list marks the stars, one over the pair list copies the pairs of
        marked stars to RAM, still sorted (CubeStar thesis, section 4.3.4).
        """
        stars = self.near(boresight, radius_deg, meter)
        marked = np.zeros(len(self), dtype=bool)
        marked[stars] = True
        first_in = marked[self.pairs.first]
        kept = first_in & marked[self.pairs.second]
        firsts, copies = int(first_in.sum()), int(kept.sum())
        count = len(self.pairs)
        meter.charge(
            flash_read=count + firsts + copies,
            table_byte=count + firsts,
            loop=count,
            ram_write=3 * copies,
        )
        pairs = PairList(self.pairs.first[kept], self.pairs.second[kept], self.pairs.angle[kept])
        return stars, pairs


def _companions(vectors: NDArray[np.float64], v_mag: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of the stars within `COMPANION_RAD` of a brighter one."""
    first, second = np.triu_indices(len(vectors), k=1)
    close = np.linalg.norm(vectors[first] - vectors[second], axis=1) < COMPANION_RAD
    first, second = first[close], second[close]
    fainter = np.zeros(len(vectors), dtype=bool)
    fainter[np.where(v_mag[first] > v_mag[second], first, second)] = True
    return fainter


def _list_pairs(vectors: NDArray[np.float64], limit_rad: float) -> PairList:
    """All pairs closer than the limit, sorted by the stored angle and then by index.

    Angles are computed from chords, which stay exact where an arc cosine would not; plain sums keep
    the result independent of the matrix library.
    """
    first, second = np.triu_indices(len(vectors), k=1)
    difference = vectors[first] - vectors[second]
    chord = np.sqrt(difference[:, 0] ** 2 + difference[:, 1] ** 2 + difference[:, 2] ** 2)
    angle = 2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0))
    close = angle < limit_rad
    stored = angle[close].astype(np.float32)
    order = np.argsort(stored, kind="stable")
    return PairList(
        first[close][order].astype(np.uint16), second[close][order].astype(np.uint16), stored[order]
    )


@lru_cache(maxsize=8)  # each image needs the same one
def _narrowed(whole: StarCatalogue, pair_limit_deg: float) -> StarCatalogue:
    count = int(np.searchsorted(whole.pairs.angle, np.float32(np.radians(pair_limit_deg))))
    first, second, angle = whole.pairs.first, whole.pairs.second, whole.pairs.angle
    return replace(
        whole,
        pairs=PairList(first[:count], second[:count], angle[:count]),
        pair_limit_deg=min(pair_limit_deg, whole.pair_limit_deg),
    )
