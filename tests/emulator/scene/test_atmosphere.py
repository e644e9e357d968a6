from datetime import UTC, datetime

import numpy as np
import pytest

from cubestack.emulator.scene.atmosphere import (
    SIDEREAL_DEG_S,
    Atmosphere,
    Vectors,
    air_mass,
    earth_rate_deg_s,
    refraction_rad,
    sidereal_deg,
)
from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene

STILL = Atmosphere(0, 90, seeing_arcsec=0, scintillation=False, extinction_mag=0)
"""At the equator, the zenith at right ascension 90: only refraction is left."""


def stars_at(heights_deg: list[float]) -> Vectors:
    """Stars south of the zenith of ``STILL`` at true heights."""
    angle = np.radians(heights_deg)
    return np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=1)


def seen(air: Atmosphere, stars: Vectors, exposure_s: float = 0.4, seed: int = 1):
    return air.apparent(stars, 0.0, exposure_s, 5.0, np.random.default_rng(seed))


def test_air_mass_and_refraction_match_published_tables() -> None:
    # Kasten and Young, table II; Bennett's and Saemundsson's refraction at true heights.
    heights = np.array([90, 60, 30, 10, 0.0])
    masses = [0.99971, 1.1539, 1.9939, 5.5841, 37.92]
    np.testing.assert_allclose(air_mass(heights), masses, rtol=1e-3)
    arcmin = np.degrees(refraction_rad(heights)) * 60
    np.testing.assert_allclose(arcmin, [0.0, 0.58, 1.73, 5.4, 28.9], atol=0.15)


def test_refraction_lifts_towards_the_zenith_and_less_up_a_mountain() -> None:
    stars = stars_at([89.999, 45.0, 20.0])
    moved, light = seen(STILL, stars)
    np.testing.assert_allclose(light, 1)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1)
    lift = np.degrees(np.arcsin(moved[:, 1]) - np.arcsin(stars[:, 1])) * 3600
    np.testing.assert_allclose(lift, [0, 59.6, 162], atol=3)
    np.testing.assert_allclose(moved[:, 0], 0, atol=1e-12)
    high, _ = seen(Atmosphere(0, 90, 4000.0, 0, scintillation=False, extinction_mag=0), stars)
    part = (np.arcsin(high[1:, 1]) - np.arcsin(stars[1:, 1])) * 206265 / lift[1:]
    np.testing.assert_allclose(part, np.exp(-0.5), rtol=1e-3)


def test_extinction_follows_air_mass_and_blocks_light_below_the_horizon() -> None:
    air = Atmosphere(0, 90, seeing_arcsec=0, scintillation=False, extinction_mag=0.3)
    _, light = seen(air, stars_at([90, 30, 5, -1]))
    np.testing.assert_allclose(-2.5 * np.log10(light[:3]), 0.3 * air_mass(np.array([90, 30, 5])))
    assert light[3] == 0


def test_scintillation_follows_youngs_formula() -> None:
    stars = np.repeat(stars_at([90.0, 40.0]), 20_000, axis=0)
    air = Atmosphere(0, 90, 0.0, 0, extinction_mag=0)
    for exposure_s in (0.1, 0.9):
        light = seen(air, stars, exposure_s)[1].reshape(2, -1)
        zenith = 0.09 * 6 ** (-2 / 3) / np.sqrt(2 * exposure_s)
        np.testing.assert_allclose(light.mean(axis=1), 1, atol=5e-3)
        expected = zenith * air_mass(np.array([90, 40])) ** 1.75
        np.testing.assert_allclose(light.std(axis=1), expected, rtol=0.03)


def test_images_move_by_the_seeing_and_less_in_longer_exposures() -> None:
    stars = np.repeat(stars_at([45.0]), 20_000, axis=0)
    level, _ = seen(STILL, stars)

    def arcsec(seeing: float, exposure_s: float) -> np.ndarray:
        air = Atmosphere(0, 90, 0.0, seeing, scintillation=False, extinction_mag=0)
        off = seen(air, stars, exposure_s)[0] - level
        across = np.array([1.0, 0, 0]), np.cross(level[0], [1.0, 0, 0])
        return np.array([(off @ axis).std() for axis in across]) * 206265

    # A mask of 5 mm moves by 1.26 arcsec in 2 arcsec of seeing, and by sqrt(2)^(1/2) more here.
    np.testing.assert_allclose(arcsec(2, 1e-6), 1.26 * 2**0.25, rtol=0.03)
    np.testing.assert_allclose(arcsec(4, 1e-6) / arcsec(2, 1e-6), 2 ** (5 / 6), rtol=0.03)
    np.testing.assert_allclose(arcsec(2, 0.8) / arcsec(2, 0.1), 8 ** (-1 / 6), rtol=0.03)


def test_atmosphere_repeats_with_the_seed_and_differs_between_seeds() -> None:
    stars = stars_at([60.0, 50.0])
    one, same, other = (seen(Atmosphere(0, 90), stars, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one[0], same[0])
    np.testing.assert_array_equal(one[1], same[1])
    assert np.all(one[0] != other[0]).any()
    assert np.all(one[1] != other[1])


def test_ground_camera_turns_with_sidereal_time() -> None:
    # Meeus, Astronomical Algorithms, example 12.b: 8 h 34 min 57.0896 s at Greenwich.
    when = datetime(1987, 4, 10, 19, 21, tzinfo=UTC)
    assert sidereal_deg(when, 0) == pytest.approx(128.7378734, abs=2e-4)
    assert sidereal_deg(when.replace(tzinfo=None), 18.86) == pytest.approx(147.5979, abs=2e-4)
    air = Atmosphere(-33.9, 200.0)
    pose = quaternion_from_pointing(200.0, -33.9, 17.0)
    scene = SkyScene(pose, earth_rate_deg_s(pose))
    for hours in (0, 3):
        boresight = matrix_from_quaternion(scene.truth(hours * 3600 * 10**12))[2]
        np.testing.assert_allclose(boresight, air.zenith(hours * 3600), atol=1e-9)
    assert np.linalg.norm(earth_rate_deg_s(pose)) == pytest.approx(SIDEREAL_DEG_S)
