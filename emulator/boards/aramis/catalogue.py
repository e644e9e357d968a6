"""Compiles AraMiS' star and triangle database from the sky.

AraMiS thesis, sections 4.5.2 (star selection), 5.5 (triangles), 5.6 (k-vectors), 5.9 (faces) and
7.1. The sky is scanned in steps of right ascension and declination; each field keeps its brightest
stars, and every triangle whose sides are all shorter than the field is listed.

The thesis counts 1312 stars and 265 292 triangles in the Bright Star Catalogue at epoch 2000; from
Hipparcos they are 1324 and 267 128. The magnitudes explain the difference, as they determine the
sixth star of each field: random shifts of 0.05 result in 1316 to 1330 stars and 262 560 to 273 131
triangles in five trials. Double stars closer than 30 arcsec counted as one would result in 1325 and
268 137. Star numbers are also those of Hipparcos: the package with the catalogue has no
cross-identification with the Harvard Revised numbers of the thesis.
"""

import hashlib
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.native.cache import cache_folder
from cubestack.emulator.scene.hipparcos import CATALOGUE_SHA256, DEFAULT_EPOCH, Sky, load_sky
from cubestack.firmware_model.aramis.catalogue import database, geodesic, kvector
from cubestack.firmware_model.aramis.catalogue.database import Database, DatabaseError
from cubestack.firmware_model.aramis.catalogue.geodesic import geodesic_sphere
from cubestack.firmware_model.aramis.catalogue.kvector import KVector
from cubestack.firmware_model.aramis.field import FOV_DEG
from cubestack.firmware_model.values import DeclaredValues, number, whole

Progress = Callable[[Iterable[int], int, str], Iterable[int]]
"""Passes items through, and reports the progress: number done of a total, and a label."""

PUBLISHED = {"stars": 1312, "triangles": 265_292}
"""Sections 4.5.2 and 5.5; for comparison, ours are not fitted to them."""

MOST_TRIANGLES = 1_400_000
"""Limit for the 32 MB of RAM of the thesis' appendix A, at 22 bytes each."""

MOST_STARS = 6000

SAME_FIELD_DEG = 1e-3

CROWDED_DEG = (8.0, 18.0)
"""Fields with more triangles than the flash holds (8 MB), if all sides up to the field counted."""

CROWDED_SIDE = 0.86
"""Longest side that their triangles have, as a part of the field: chosen, the largest database (13
deg) then just fits."""

ADVICE = "change fov_deg, stars_per_field, longest_side_deg or mag_limit"


@dataclass(frozen=True)
class CatalogueParameters(DeclaredValues):
    """Parameters of a database; the defaults are the published ones."""

    fov_deg: float = number(FOV_DEG, "diameter of the round field of view", 1, 60)
    stars_per_field: int = whole(6, "brightest stars that each field keeps", 3, 50)
    mag_limit: float = number(6.0, "faintest V magnitude, included", 0, 7.5)
    step_deg: float = number(1.0, "step of the scan in right ascension and declination", 0.25, 10)
    epoch: float = number(DEFAULT_EPOCH, "Julian year of the directions", 1800, 2200)
    longest_side_deg: float | None = number(
        None, "no side of a triangle is longer; None: the field", 1, 60
    )

    @property
    def side_deg(self) -> float:
        return self.fov_deg if self.longest_side_deg is None else self.longest_side_deg


#: Databases of this process, the latest last.
_kept: dict[CatalogueParameters, Database] = {}


def _silent(items: Iterable[int], total: int, label: str) -> Iterable[int]:
    return items


def select_stars(
    sky: Sky, parameters: CatalogueParameters, progress: Progress = _silent
) -> NDArray[np.intp]:
    """Stars of ``sky`` that are among the brightest of at least one field, brightest first."""
    bright = np.flatnonzero(sky.v_mag <= parameters.mag_limit)
    bright = bright[np.argsort(sky.v_mag[bright], kind="stable")]
    vectors = sky.vectors[bright]
    declination = np.arcsin(np.clip(vectors[:, 2], -1, 1))
    radius = np.radians(parameters.fov_deg / 2)
    kept = np.zeros(len(bright), dtype=bool)
    rows = np.radians(np.append(np.arange(-90.0, 90.0, parameters.step_deg), 90.0))
    for row in progress(range(len(rows)), len(rows), "scanning the sky"):
        band = np.flatnonzero(np.abs(declination - rows[row]) <= radius + 1e-9)
        inside = _fields(rows[row], parameters.step_deg) @ vectors[band].T >= np.cos(radius)
        rank = np.cumsum(inside, axis=1, dtype=np.int32)
        kept[band] |= (inside & (rank <= parameters.stars_per_field)).any(axis=0)
    return bright[kept]


def build_database(
    parameters: CatalogueParameters | None = None, progress: Progress = _silent
) -> Database:
    """Compile the database; ValueError if the parameters result in no triangle, or too many."""
    parameters = parameters or CatalogueParameters()
    sky = load_sky(parameters.epoch)
    chosen = np.sort(select_stars(sky, parameters, progress))
    if len(chosen) > MOST_STARS:
        raise ValueError(f"{len(chosen)} stars are more than {MOST_STARS}; {ADVICE}")
    vectors = sky.vectors[chosen]
    triples = _triples(vectors, np.radians(parameters.side_deg), progress)
    areas, moments = _properties(vectors[triples])
    order = np.argsort(areas, kind="stable")
    order = order[areas[order] > 0]
    if len(order) == 0:
        raise ValueError(f"{len(chosen)} stars form no triangle; {ADVICE}")
    triples, areas, moments = triples[order], areas[order], moments[order]
    by_moment = np.argsort(moments, kind="stable")
    sphere = geodesic_sphere()
    return Database(
        epoch=parameters.epoch,
        fov_deg=parameters.side_deg,
        numbers=sky.hip[chosen].astype(np.uint32),
        vectors=vectors.astype(np.float32),
        v_mag=sky.v_mag[chosen].astype(np.float32),
        stars=triples.astype(np.uint16),
        faces=_nearest_faces(vectors[triples], sphere.centres.astype(np.float64)),
        areas=areas,
        moments=moments[by_moment],
        moment_triangles=by_moment.astype(np.uint32),
        area_index=KVector.build(areas),
        moment_index=KVector.build(moments[by_moment]),
        sphere=sphere,
    )


def onboard_database(field_deg: float = FOV_DEG, progress: Progress = _silent) -> Database:
    """The onboard catalogue for a lens with this field of view; the latest two are cached."""
    usual = abs(field_deg - FOV_DEG) < SAME_FIELD_DEG
    crowded = CROWDED_DEG[0] < field_deg < CROWDED_DEG[1]
    parameters = CatalogueParameters(
        fov_deg=FOV_DEG if usual else field_deg,
        longest_side_deg=CROWDED_SIDE * field_deg if crowded else None,
    )
    if parameters not in _kept:
        built = cached_database(parameters, progress)
        while len(_kept) > 1:
            del _kept[next(iter(_kept))]
        _kept[parameters] = built
    return _kept[parameters]


def cached_database(
    parameters: CatalogueParameters | None = None,
    progress: Progress = _silent,
    folder: Path | None = None,
) -> Database:
    """The database from the user's cache folder, or built now and stored there.

    ``folder`` replaces :func:`cubestack.emulator.native.cache.cache_folder`. A damaged file is
    replaced; without write access to the folder, the database is built each time.
    """
    parameters = parameters or CatalogueParameters()
    folder = cache_folder() if folder is None else folder
    path = folder / f"aramis-{_key(parameters)}.bin"
    with suppress(OSError, DatabaseError):
        return Database.unpack(path.read_bytes())
    built = build_database(parameters, progress)
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            image = Path(scratch) / path.name
            image.write_bytes(built.pack())
            image.replace(path)
    return built


def _key(parameters: CatalogueParameters) -> str:
    """Hash of everything that the database depends on, including this code."""
    digest = hashlib.sha256(repr(sorted(asdict(parameters).items())).encode())
    digest.update(CATALOGUE_SHA256.encode())
    for source in (__file__, database.__file__, geodesic.__file__, kvector.__file__):
        digest.update(Path(source).read_bytes())
    return digest.hexdigest()[:24]


def _fields(declination: float, step_deg: float) -> NDArray[np.float64]:
    """Centres (k, 3) of the fields at one declination in rad."""
    ascension, across = np.radians(np.arange(0.0, 360.0, step_deg)), np.cos(declination)
    up = np.full_like(ascension, np.sin(declination))
    return np.stack([across * np.cos(ascension), across * np.sin(ascension), up], axis=1)


def _triples(
    vectors: NDArray[np.float64], limit_rad: float, progress: Progress
) -> NDArray[np.intp]:
    """Index triples (m, 3), ascending, of stars that are pairwise closer than the limit."""
    near = vectors @ vectors.T > np.cos(limit_rad)
    parts, count = [np.zeros((0, 3), dtype=np.intp)], 0
    for first in progress(range(len(vectors)), len(vectors), "listing triangles"):
        others = first + 1 + np.flatnonzero(near[first, first + 1 :])
        second, third = np.nonzero(np.triu(near[np.ix_(others, others)], 1))
        triples = np.stack([np.full(len(second), first), others[second], others[third]], axis=1)
        parts.append(triples.astype(np.intp))
        count += len(triples)
        if count > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles; {ADVICE}")
    return np.concatenate(parts)


def _properties(corners: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Areas and polar moments (m,) of triangles (m, 3, 3): equations 5.7 and 5.17."""
    first, second, third = corners.transpose(1, 0, 2)
    edges = first - second, second - third, first - third
    a, b, c = (np.linalg.norm(edge, axis=1) for edge in edges)
    half = (a + b + c) / 2
    areas = np.sqrt(np.maximum(half * (half - a) * (half - b) * (half - c), 0))
    return areas.astype(np.float32), (areas * (a**2 + b**2 + c**2) / 36).astype(np.float32)


def _nearest_faces(
    corners: NDArray[np.float64], centres: NDArray[np.float64]
) -> NDArray[np.uint16]:
    """Face (m,) whose centre is closest to each triangle's centre."""
    middles = corners.sum(axis=1)
    parts: list[NDArray[Any]] = [
        np.argmax(middles[start : start + 20_000] @ centres.T, axis=1)
        for start in range(0, len(middles), 20_000)
    ]
    return np.concatenate(parts).astype(np.uint16)
