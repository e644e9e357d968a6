"""The flash image: what goes in comes out, and damage is noticed."""

import struct
from zlib import crc32

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.firmware_model.aramis.catalogue.database import HEADER, Database, DatabaseError

from ..sky import database

SMALL = CatalogueParameters(fov_deg=12, stars_per_field=4, mag_limit=4)


@pytest.fixture(scope="module")
def image() -> bytes:
    return database(SMALL).pack()


def sealed(image: bytes) -> bytes:
    return image[:-4] + struct.pack("<I", crc32(image[:-4]))


def place(image: bytes, wanted: str) -> int:
    parts = Database.unpack(image).sizes
    return sum(list(parts.values())[: list(parts).index(wanted)])


def test_unpacking_restores_what_was_packed(image: bytes) -> None:
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


def test_memory_is_as_good_as_bytes(image: bytes) -> None:
    assert Database.unpack(memoryview(bytearray(image))).pack() == image


def test_the_published_database_takes_6_megabytes() -> None:
    assert sum(database().sizes.values()) == pytest.approx(5.9e6, rel=0.02)


@pytest.mark.parametrize("length", [0, 3, HEADER.size, 200])
def test_rejects_short_image(image: bytes, length: int) -> None:
    with pytest.raises(DatabaseError, match="bytes"):
        Database.unpack(image[:length])


@pytest.mark.parametrize("seed", range(20))
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
def test_rejects_misleading_contents(image: bytes, name: str, value: bytes, words: str) -> None:
    start = place(image, name)
    with pytest.raises(DatabaseError, match=words):
        Database.unpack(sealed(image[:start] + value + image[start + len(value) :]))


@pytest.mark.parametrize(("offset", "value"), [(0, b"XRAM"), (4, b"\x09\x00")])
def test_rejects_other_kinds_of_image(image: bytes, offset: int, value: bytes) -> None:
    other = image[:offset] + value + image[offset + len(value) :]
    with pytest.raises(DatabaseError, match="an image starts with"):
        Database.unpack(sealed(other))


def test_rejects_inconsistent_counts(image: bytes) -> None:
    for offset in (8, 12, 16, 20, 24):
        other = image[:offset] + b"\x01\x00" + image[offset + 2 :]
        with pytest.raises(DatabaseError):
            Database.unpack(sealed(other))
