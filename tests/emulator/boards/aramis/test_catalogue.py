"""The ground tool: selection, triangles and cache, against slow and plain ways to the same."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.boards.aramis import catalogue as aramis_catalogue
from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import FOV_DEG
from cubestack.firmware_model.interface.aramis import MOST_CATALOGUE_BYTES

SMALL = CatalogueParameters(fov_deg=20, stars_per_field=3, mag_limit=3, step_deg=5)


def cached(folder: Path, parameters: CatalogueParameters = SMALL) -> bytes:
    return aramis_catalogue.cached_database(parameters, folder=folder).pack()


@pytest.fixture(scope="module")
def small() -> Database:
    return build_database(SMALL)


@pytest.fixture(scope="module")
def published() -> Database:
    return build_database(CatalogueParameters(epoch=2000))


def test_star_counts_match_published_ones(published: Database) -> None:
    """Within 1 %: another catalogue has other magnitudes (see the module)."""
    counts = {"stars": len(published.numbers), "triangles": len(published)}
    assert counts == {"stars": 1324, "triangles": 267_128}
    assert counts == pytest.approx(aramis_catalogue.PUBLISHED, rel=0.01)


def test_proper_motion_moves_stars() -> None:
    first, second = (
        build_database(CatalogueParameters(fov_deg=20, stars_per_field=3, epoch=epoch))
        for epoch in (2000, 2026)
    )
    shared, at_first, at_second = np.intersect1d(first.numbers, second.numbers, return_indices=True)
    assert len(shared) > 0.99 * len(first.numbers)
    moved = np.linalg.norm(first.vectors[at_first] - second.vectors[at_second], axis=1)
    alpha_centauri = moved[shared == 71683][0]
    assert np.degrees(alpha_centauri) * 3600 == pytest.approx(26 * 3.7, rel=0.02)


def test_catalogue_keeps_the_brightest_stars_of_each_field() -> None:
    sky = load_sky(SMALL.epoch)
    bright = np.flatnonzero(sky.v_mag <= SMALL.mag_limit)
    expected = set()
    for declination in range(-90, 91, 5):
        for ascension in range(0, 360, 5):
            ra, dec = np.radians([ascension, declination])
            middle = [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
            angles = np.degrees(np.arccos(np.clip(sky.vectors[bright] @ middle, -1, 1)))
            inside = bright[angles <= SMALL.fov_deg / 2]
            expected |= set(inside[np.argsort(sky.v_mag[inside])][:3].tolist())
    assert set(aramis_catalogue.select_stars(sky, SMALL).tolist()) == expected


def test_lists_every_triangle_within_the_limits(small: Database) -> None:
    vectors = small.vectors.astype(np.float64)
    near = np.degrees(np.arccos(np.clip(vectors @ vectors.T, -1, 1))) < SMALL.fov_deg
    expected = {
        triple
        for triple in combinations(range(len(vectors)), 3)
        if all(near[a, b] for a, b in combinations(triple, 2))
    }
    assert set(map(tuple, small.stars.tolist())) == expected
    assert len(small) == len(expected)


def test_stored_areas_and_moments_are_right_and_sorted(small: Database) -> None:
    corners = small.vectors.astype(np.float64)[small.stars]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.linalg.norm(np.cross(first, second), axis=1) / 2
    spread = corners - corners.mean(axis=1, keepdims=True)
    moments = areas * np.sum(spread**2, axis=(1, 2)) / 12
    np.testing.assert_allclose(small.areas, areas, rtol=2e-3)
    np.testing.assert_allclose(small.moments, moments[small.moment_triangles], rtol=2e-3)
    assert min(np.diff(small.areas).min(), np.diff(small.moments).min()) >= 0
    assert sorted(small.moment_triangles.tolist()) == list(range(len(small)))


def test_triangles_lie_in_the_face_nearest_to_their_centre(small: Database) -> None:
    middles = small.vectors[small.stars].mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    distances = np.linalg.norm(middles[:, None] - small.sphere.centres, axis=2)
    chosen = distances[np.arange(len(small)), small.faces]
    np.testing.assert_allclose(chosen, distances.min(axis=1), atol=1e-5)


def test_shorter_longest_side_leaves_fewer_triangles(small: Database) -> None:
    fewer = build_database(replace(SMALL, longest_side_deg=15))
    assert 0 < len(fewer) < len(small)
    assert len(fewer.numbers) == len(small.numbers)


def test_caches_each_database_in_a_file_of_its_own(
    tmp_path: Path, small: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = cached(tmp_path / "new")
    (file,) = (tmp_path / "new").iterdir()
    assert first == small.pack() == file.read_bytes()
    cached(tmp_path / "new", replace(SMALL, mag_limit=2.9))
    assert len(list((tmp_path / "new").iterdir())) == 2
    monkeypatch.setattr(aramis_catalogue, "build_database", None)
    assert cached(tmp_path / "new") == small.pack()


def test_damaged_cache_file_is_rebuilt(tmp_path: Path, small: Database) -> None:
    cached(tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    assert cached(tmp_path) == small.pack()
    assert file.read_bytes() == small.pack()


def test_cache_folder_that_cannot_be_created_is_ignored(tmp_path: Path, small: Database) -> None:
    (tmp_path / "file").write_text("in the way")
    assert cached(tmp_path / "file" / "x") == small.pack()


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, small: Database) -> list[CatalogueParameters]:
    """What databases are made of; each is the small one but for its field."""
    parameters = list[CatalogueParameters]()

    def make(of: CatalogueParameters, _progress: object) -> Database:
        parameters.append(of)
        return replace(small, fov_deg=of.fov_deg)

    monkeypatch.setattr(aramis_catalogue, "_kept", {})
    monkeypatch.setattr(aramis_catalogue, "cached_database", make)
    return parameters


def test_cache_keeps_the_last_two_lenses(asked: list[CatalogueParameters]) -> None:
    fields_deg = [10.0, 12.0, 10.0, 12.0, 14.0, 12.0, 14.0, 10.0]
    given = [aramis_catalogue.onboard_database(field_deg).fov_deg for field_deg in fields_deg]
    assert given == fields_deg
    assert [made.fov_deg for made in asked] == [10.0, 12.0, 14.0, 10.0]


@pytest.mark.parametrize(
    ("off_deg", "made_for_deg"),
    [(0.0, FOV_DEG), (5e-4, FOV_DEG), (-5e-4, FOV_DEG), (2.0, FOV_DEG + 2)],
)
def test_rounded_default_field_reuses_the_default_catalogue(
    asked: list[CatalogueParameters], off_deg: float, made_for_deg: float
) -> None:
    """A lens file's rounded field is no reason to build another one."""
    assert aramis_catalogue.onboard_database(FOV_DEG + off_deg).fov_deg == made_for_deg
    assert asked == [CatalogueParameters(fov_deg=made_for_deg)]


def test_reports_progress() -> None:
    seen: dict[str, int] = {}

    def watch(items: Iterable[int], total: int, label: str) -> list[int]:
        numbers = list(items)
        assert len(numbers) == total
        seen[label] = total
        return numbers

    built = build_database(SMALL, watch)
    assert seen == {"scanning the sky": 37, "listing triangles": len(built.numbers)}


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (CatalogueParameters(fov_deg=1, mag_limit=1, step_deg=10), "stars form no triangle"),
        (CatalogueParameters(fov_deg=60, stars_per_field=50, step_deg=10), "more than 1400000"),
    ],
)
def test_rejects_impossible_parameters(parameters: CatalogueParameters, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        build_database(parameters)


@pytest.mark.slow
@pytest.mark.parametrize("field_deg", [8.0, 13.0, 17.99, 18.0])
def test_catalogues_of_crowded_fields_fit_into_the_flash(field_deg: float) -> None:
    assert len(aramis_catalogue.onboard_database(field_deg).pack()) <= MOST_CATALOGUE_BYTES
