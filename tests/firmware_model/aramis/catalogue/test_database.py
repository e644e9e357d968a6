"""The flash image: what goes in comes out, and damage is noticed."""

import struct
from zlib import crc32

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.firmware_model.aramis.catalogue.database import HEADER, Database, DatabaseError
from cubestack.firmware_model.aramis.catalogue.geodesic import NO_FACE, geodesic_sphere
from cubestack.firmware_model.aramis.catalogue.kvector import KVector
from cubestack.host.studies.aramis.sky import database, meter
from tests.together import together

SMALL = CatalogueParameters(fov_deg=12, stars_per_field=4, mag_limit=4)


@pytest.fixture(scope="module")
def image() -> bytes:
    return database(SMALL).pack()


def changed(image: bytes, offset: int, value: bytes) -> bytes:
    """Sealed with a checksum that is right again."""
    other = image[:offset] + value + image[offset + len(value) :]
    return other[:-4] + struct.pack("<I", crc32(other[:-4]))


def place(image: bytes, wanted: str) -> int:
    parts = Database.unpack(image).sizes
    return sum(list(parts.values())[: list(parts).index(wanted)])


def test_database_round_trips_through_its_image(image: bytes) -> None:
    first, second = database(SMALL), Database.unpack(image)
    assert sum(first.sizes.values()) == len(image)
    for name in ("numbers", "vectors", "v_mag", "stars", "faces", "areas", "moments"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    np.testing.assert_array_equal(second.area_index.starts, first.area_index.starts)
    np.testing.assert_array_equal(second.sphere.neighbours, first.sphere.neighbours)
    assert second.moment_index.highest == first.moment_index.highest
    assert second.fov_deg == pytest.approx(first.fov_deg)
    assert second.epoch == first.epoch
    assert second.pack() == image


def test_database_unpacks_from_a_memoryview(image: bytes) -> None:
    assert Database.unpack(memoryview(bytearray(image))).pack() == image


def test_published_database_takes_6_megabytes() -> None:
    assert sum(database().sizes.values()) == pytest.approx(5.9e6, rel=0.02)


@pytest.mark.parametrize("length", [0, 3, HEADER.size, 200])
def test_rejects_short_image(image: bytes, length: int) -> None:
    with pytest.raises(DatabaseError, match="bytes"):
        Database.unpack(image[:length])


@together("seed", range(20))
def test_detects_any_flipped_bit(image: bytes, seed: int) -> None:
    rng = np.random.default_rng(seed)
    damaged = bytearray(image)
    damaged[rng.integers(len(image))] ^= 1 << rng.integers(8)
    with pytest.raises(DatabaseError):
        Database.unpack(bytes(damaged))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("stars", b"\xff\xff", "stars of the image reach 65535"),
        ("faces", b"\x40\x01", "faces of the image reach 320, not 319"),
        ("moment_triangles", b"\xff\xff\xff\xff", "moment_triangles of the image reach"),
        ("area_starts", b"\x40\x00\x00\x00", "area_starts of the image fall"),
        ("vectors", struct.pack("<f", float("nan")), "vectors of the image are not all finite"),
    ],
)
def test_database_rejects_inconsistent_contents(
    image: bytes, name: str, value: bytes, words: str
) -> None:
    with pytest.raises(DatabaseError, match=words):
        Database.unpack(changed(image, place(image, name), value))


@pytest.mark.parametrize(("offset", "value"), [(0, b"XRAM"), (4, b"\x09\x00")])
def test_rejects_other_kinds_of_image(image: bytes, offset: int, value: bytes) -> None:
    with pytest.raises(DatabaseError, match="an image starts with"):
        Database.unpack(changed(image, offset, value))


def test_rejects_inconsistent_counts(image: bytes) -> None:
    for offset in (8, 12, 16, 20, 24):
        with pytest.raises(DatabaseError):
            Database.unpack(changed(image, offset, b"\x01\x00"))


SPHERE = geodesic_sphere()
CENTRES = SPHERE.centres.astype(np.float64)


def directions(count: int, seed: int = 0) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(("splits", "faces"), [(0, 20), (1, 80), (2, 320)])
def test_geodesic_split_turns_each_face_into_four(splits: int, faces: int) -> None:
    assert len(geodesic_sphere(splits)) == faces


@pytest.mark.parametrize("splits", [-1, 5])
def test_rejects_splits_out_of_range(splits: int) -> None:
    with pytest.raises(ValueError, match=f"splits must be 0 to 4, not {splits}"):
        geodesic_sphere(splits)


def test_geodesic_faces_come_in_opposite_pairs() -> None:
    opposite = CENTRES @ -CENTRES.T
    np.testing.assert_allclose(opposite.max(axis=1), 1, atol=1e-6)


def test_centres_are_spread_evenly() -> None:
    """Regions of nearest centre take between 0.7 and 1.4 of their share of the sphere."""
    nearest = np.argmax(directions(64_000) @ CENTRES.T, axis=1)
    share = np.bincount(nearest, minlength=320) / 200
    assert 0.7 < share.min() < share.max() < 1.4


def test_geodesic_faces_have_12_neighbours_but_11_at_the_corners() -> None:
    assert SPHERE.neighbours.shape == (320, 12)
    counts = (SPHERE.neighbours != NO_FACE).sum(axis=1)
    assert sorted(set(counts.tolist())) == [11, 12]
    assert (counts == 11).sum() == 12 * 5


def test_geodesic_neighbours_are_mutual_and_nearest() -> None:
    for face, row in enumerate(SPHERE.neighbours):
        others = row[row != NO_FACE]
        assert face not in others
        assert len(set(others.tolist())) == len(others)
        assert all(face in SPHERE.neighbours[other] for other in others)
        nearest = np.argsort(-(CENTRES @ CENTRES[face]))[1 : 1 + 3]
        assert set(nearest.tolist()) <= set(others.tolist())


def test_a_direction_lies_in_the_face_with_the_nearest_centre() -> None:
    spent = meter()
    for vector in directions(200, 1):
        face = SPHERE.face_of(vector.astype(np.float32), spent)
        assert CENTRES[face] @ vector >= (CENTRES @ vector).max() - 1e-6
    assert spent.counts["f32_mul"] == 200 * 3 * 320


def test_faces_around_a_boresight_cover_half_a_field() -> None:
    """What section 5.9 asks of the size of the faces: half a field of 21.5 deg from a boresight
    anywhere in the face."""
    rng = np.random.default_rng(2)
    for boresight in directions(300, 3):
        marked = SPHERE.around(boresight.astype(np.float32), meter())
        assert 12 <= marked.sum() <= 13
        aside = np.cross(boresight, rng.normal(size=(50, 3)))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        angle = np.radians(21.53 / 2)
        around = np.cos(angle) * boresight + np.sin(angle) * aside
        assert marked[np.argmax(around @ CENTRES.T, axis=1)].all()


Values = NDArray[np.float32]


def brute_force(rising: Values, low: np.float32, high: np.float32) -> list[int]:
    return np.flatnonzero((rising >= low) & (rising <= high)).tolist()


def found(rising: Values, low: float, high: float, per_bin: int = 4) -> list[int]:
    vector = KVector.build(rising, per_bin)
    places = vector.find(rising, np.float32(low), np.float32(high), meter())
    return list(range(places.start, places.stop))


floats = st.floats(-1e6, 1e6, width=32)


@example([0.0, 1e-45], 0.0, 0.0, 1)
@example([7.0] * 50, 7.0, 7.0, 4)
@given(st.lists(floats, min_size=1, max_size=200), floats, floats, st.integers(1, 30))
@settings(max_examples=300, deadline=None)
def test_k_vector_range_search_equals_brute_force(
    values: list[float], a: float, b: float, per_bin: int
) -> None:
    rising = np.sort(np.array(values, dtype=np.float32))
    low, high = np.float32(min(a, b)), np.float32(max(a, b))
    assert found(rising, float(low), float(high), per_bin) == brute_force(rising, low, high)


@given(st.lists(floats, min_size=1, max_size=60), st.data())
@settings(max_examples=200, deadline=None)
def test_k_vector_range_includes_bounds_equal_to_values(
    values: list[float], data: st.DataObject
) -> None:
    rising = np.sort(np.array(values, dtype=np.float32))
    value = st.sampled_from(rising.tolist())
    low, high = sorted((data.draw(value), data.draw(value)))
    assert found(rising, low, high) == brute_force(rising, np.float32(low), np.float32(high))


@pytest.mark.parametrize("name", ["area", "moment"])
def test_k_vector_search_of_the_real_lists_equals_brute_force(name: str) -> None:
    onboard, rng = database(), np.random.default_rng(4)
    rising, vector = getattr(onboard, f"{name}s"), getattr(onboard, f"{name}_index")
    looked_at = []
    for _ in range(300):
        middle = rising[rng.integers(len(rising))]
        width = np.float32(middle * rng.uniform(0, 0.02))
        low, high = np.float32(middle - width), np.float32(middle + width)
        places = vector.find(rising, low, high, meter())
        start, stop = np.searchsorted(rising, low), np.searchsorted(rising, high, side="right")
        assert (places.start, places.stop) == (start, stop)
        assert places.looked_at >= len(places)
        looked_at.append(places.looked_at - len(places))
    assert max(looked_at) < 0.001 * len(rising)


@pytest.mark.parametrize(
    ("low", "high"), [(2.0, 1.0), (5.0, 6.0), (-2.0, -1.0), (np.nan, 1.0), (0.0, np.nan)]
)
def test_k_vector_search_of_an_empty_range_finds_nothing(low: float, high: float) -> None:
    assert found(np.array([0, 1, 2, 3], dtype=np.float32), low, high) == []


def test_k_vector_search_charges_each_comparison() -> None:
    rising = np.arange(1000, dtype=np.float32)
    vector = KVector.build(rising, 10)
    spent = meter()
    places = vector.find(rising, np.float32(500), np.float32(520), spent)
    trimmed = places.looked_at - len(places)
    assert (spent.counts["loop"], spent.counts["f32_mul"]) == (trimmed + 2, 6)
