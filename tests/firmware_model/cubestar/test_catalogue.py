import hashlib
import math
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.cubestar.catalogue import CatalogueError, StarCatalogue

from .sky import meter


def random_sky(
    count: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(count, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return rng.permutation(10 * count)[:count].astype(np.int64), vectors, rng.uniform(0, 6, count)


def angle_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def test_catalogue_lists_stars_brighter_than_the_limit_by_number() -> None:
    hip, vectors, v_mag = random_sky(60, 1)
    v_mag[7] = 3.0
    catalogue = StarCatalogue.build(hip, vectors, v_mag, mag_limit=3.0, pair_limit_deg=40)
    assert catalogue.hip.tolist() == sorted(hip[v_mag < 3.0].tolist())
    where = {number: row for row, number in enumerate(hip.tolist())}
    rows = [where[number] for number in catalogue.hip.tolist()]
    assert np.array_equal(catalogue.vectors, vectors[rows].astype(np.float32))
    assert np.array_equal(catalogue.v_mag, v_mag[rows])


def test_pair_list_has_all_pairs_below_the_limit_in_rising_order() -> None:
    hip, vectors, v_mag = random_sky(60, 2)
    catalogue = StarCatalogue.build(hip, vectors, v_mag, mag_limit=9.0, pair_limit_deg=35)
    ordered = vectors[np.argsort(hip)]
    expected = {
        (i, j): angle
        for i, j in combinations(range(60), 2)
        if (angle := angle_between(ordered[i], ordered[j])) < math.radians(35)
    }
    pairs = catalogue.pairs
    found = {
        (i, j): angle for i, j, angle in zip(pairs.first, pairs.second, pairs.angle, strict=True)
    }
    assert len(found) == len(pairs)
    assert found == pytest.approx(expected, rel=1e-7)
    assert np.all(np.diff(pairs.angle) >= 0)


def test_catalogue_bytes_do_not_depend_on_the_source_order() -> None:
    hip, vectors, v_mag = random_sky(80, 3)
    shuffle = np.random.default_rng(4).permutation(80)
    one = StarCatalogue.build(hip, vectors, v_mag, 4.0, 50)
    other = StarCatalogue.build(hip[shuffle], vectors[shuffle], v_mag[shuffle], 4.0, 50)
    assert one.to_bytes() == other.to_bytes()
    assert one.sha256() == hashlib.sha256(one.to_bytes()).hexdigest()


def test_bytes_hold_the_arrays_in_the_documented_order() -> None:
    catalogue = StarCatalogue.build(*random_sky(30, 5), mag_limit=4.0, pair_limit_deg=60)
    stars, pairs = len(catalogue), len(catalogue.pairs)
    data = catalogue.to_bytes()
    assert len(data) == catalogue.star_bytes + catalogue.pair_bytes == 14 * stars + 8 * pairs
    layout = [("<u2", stars), *3 * [("<f4", stars)], *2 * [("<u2", pairs)], ("<f4", pairs)]
    offset, arrays = 0, []
    for kind, count in layout:
        arrays.append(np.frombuffer(data, kind, count, offset))
        offset += arrays[-1].nbytes
    assert offset == len(data)
    assert arrays[0].tolist() == list(range(stars))
    assert np.array_equal(np.stack(arrays[1:4], axis=1), catalogue.vectors)
    listed = catalogue.pairs
    assert all(map(np.array_equal, arrays[4:], (listed.first, listed.second, listed.angle)))


def test_catalogue_sizes_match_the_published_ones() -> None:
    hip, vectors, v_mag = random_sky(405, 6)
    catalogue = StarCatalogue.build(hip, vectors, v_mag, 9.0, 42.1)
    assert catalogue.star_bytes / 1024 == pytest.approx(5.54, abs=0.005)
    assert catalogue.pair_bytes / len(catalogue.pairs) * 11_484 / 1024 == pytest.approx(89.7, 1e-3)


def test_catalogue_omits_the_fainter_of_two_close_stars() -> None:
    def beside(angle: float) -> NDArray[np.float64]:
        return np.array([math.sin(angle), 0.0, math.cos(angle)])

    vectors = np.array([beside(0), beside(0.0004), beside(1.0), beside(1.0017)])
    catalogue = StarCatalogue.build(
        np.array([4, 3, 2, 1], dtype=np.int64), vectors, np.array([1.0, 0.5, 2.0, 1.0]), 3.8, 90
    )
    assert catalogue.hip.tolist() == [1, 2, 3]


def test_hipparcos_gives_the_published_lists() -> None:
    sky = load_sky(2026.0, 3.8)
    catalogue = StarCatalogue.build(sky.hip, sky.vectors, sky.v_mag, 3.8, 42.105)
    assert len(catalogue) == 405
    assert set(sky.hip.tolist()) - set(catalogue.hip.tolist()) == {71681}  # alpha Centauri B
    assert 11_484 <= len(catalogue.pairs) <= 11_486
    assert catalogue.pairs.angle[:2] == pytest.approx([0.0017, 0.0067], abs=5e-5)
    assert catalogue.pairs.angle[2] > 0.01


@pytest.mark.parametrize("radius_deg", [5.0, 35.0, 120.0])
def test_reduced_catalogue_keeps_stars_and_pairs_within_the_cap(radius_deg: float) -> None:
    hip, vectors, v_mag = random_sky(300, 7)
    catalogue = StarCatalogue.build(hip, vectors, v_mag, 9.0, 50)
    boresight = np.array([0.6, -0.48, 0.64])
    stars, pairs = catalogue.reduced(boresight.astype(np.float32), radius_deg, meter())
    inside = {
        star
        for star, vector in enumerate(vectors[np.argsort(hip)])
        if angle_between(vector, boresight) < math.radians(radius_deg)
    }
    assert stars.tolist() == sorted(inside)
    full = zip(catalogue.pairs.first.tolist(), catalogue.pairs.second.tolist(), strict=True)
    cut = zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)
    assert list(cut) == [(i, j) for i, j in full if i in inside and j in inside]
    assert np.all(np.diff(pairs.angle) >= 0)


def test_reduced_catalogue_charges_one_pass_and_its_copies() -> None:
    catalogue = StarCatalogue.build(*random_sky(300, 8), mag_limit=9.0, pair_limit_deg=50)
    boresight = np.array([0, 0, 1], dtype=np.float32)
    narrow, wide = meter(), meter()
    _, few = catalogue.reduced(boresight, 10.0, narrow)
    _, many = catalogue.reduced(boresight, 60.0, wide)
    assert narrow.counts["loop"] == wide.counts["loop"] == 300 + len(catalogue.pairs)
    assert narrow.counts["f32_mul"] == 900
    copied = wide.counts["ram_write"] - narrow.counts["ram_write"]
    assert copied == 3 * (len(many) - len(few)) > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mag_limit": -2.0}, "magnitude limit -2.0 leaves 0 stars"),
        ({"pair_limit_deg": 0.0}, "pair_limit_deg must lie in 0 to 180, not 0.0"),
        ({"v_mag": np.zeros(3)}, r"magnitudes of shape \(10,\), not \(10, 3\) and \(3,\)"),
        ({"unit_vectors": np.ones((10, 3))}, "unit_vectors must have length 1"),
    ],
)
def test_rejects_impossible_catalogues(change: dict[str, object], message: str) -> None:
    hip, vectors, v_mag = random_sky(10, 9)
    sky = {"hip": hip, "unit_vectors": vectors, "v_mag": v_mag}
    limits = {"mag_limit": 4.0, "pair_limit_deg": 42.1}
    with pytest.raises(CatalogueError, match=message):
        StarCatalogue.build(**{**sky, **limits, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("limit_deg", [10.0, 42.1, 50.0, 57.3])
def test_narrower_pair_list_equals_the_start_of_a_wider_one(limit_deg: float) -> None:
    wide, narrow = (
        StarCatalogue.build(*random_sky(200, 9), mag_limit=9.0, pair_limit_deg=limit)
        for limit in (50.0, min(limit_deg, 50.0))
    )
    found = wide.with_pair_limit(limit_deg)
    assert found.pair_limit_deg == narrow.pair_limit_deg
    assert found.to_bytes() == narrow.to_bytes()
