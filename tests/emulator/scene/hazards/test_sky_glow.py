import numpy as np
import pytest

from cubestack.emulator.scene.hazards import ephemeris
from cubestack.emulator.scene.hazards.contract import direction
from cubestack.emulator.scene.hazards.sky_glow import SkyGlow, milky_way, zodiacal
from tests.emulator.scene.hazards.looks import NOW


def mag_arcsec2(hazard: SkyGlow, vector: np.ndarray) -> float:
    glow = hazard.glow(NOW, vector[None])
    return float(-2.5 * np.log10(glow[0] / 4.2545e10))


def test_ecliptic_pole_is_60_s10_or_v_23_3() -> None:
    pole = ephemeris.FROM_ECLIPTIC[:, 2]
    assert mag_arcsec2(SkyGlow(milky_way=0), pole) == pytest.approx(23.3, abs=0.05)


@pytest.mark.parametrize(
    ("longitude_deg", "latitude_deg", "s10"),
    # Leinert et al. 1998, table 16: the same measurements in S10.
    [(180, 0, 180), (90, 0, 202), (60, 0, 395), (30, 0, 1940), (15, 0, 9000), (120, 60, 60)],
)
def test_zodiacal_light_by_the_other_table(
    longitude_deg: float, latitude_deg: float, s10: float
) -> None:
    found = zodiacal(np.array([float(longitude_deg)]), np.array([float(latitude_deg)]))
    assert found[0] == pytest.approx(s10, rel=0.02)


def test_zodiacal_light_has_no_steps() -> None:
    longitudes = np.linspace(15, 180, 3301)
    for latitude in (0.0, 7.0, 44.99, 45.01, 80.0):
        light = zodiacal(longitudes, np.full_like(longitudes, latitude))
        assert np.abs(np.diff(np.log(light))).max() < 0.01


def test_is_brighter_towards_the_sun_of_the_date() -> None:
    hazard = SkyGlow(milky_way=0, julian_date=ephemeris.NEW_YEAR_2026)
    sun = -ephemeris.heliocentric("earth", ephemeris.NEW_YEAR_2026)
    sun /= np.linalg.norm(sun)
    beside = np.cross(ephemeris.FROM_ECLIPTIC[:, 2], sun)
    near = np.cos(np.pi / 6) * sun + np.sin(np.pi / 6) * beside
    assert mag_arcsec2(hazard, near) == pytest.approx(27.78 - 2.5 * np.log10(1940), abs=0.03)


def test_milky_way_at_the_published_places() -> None:
    pole = direction("pole", (192.85948, 27.12825))
    centre, away = direction("centre", (266.405, -28.936)), direction("away", (86.405, 28.936))
    np.testing.assert_allclose(milky_way(np.array([pole, centre, away])), [30, 640, 160], rtol=0.02)


def test_milky_way_is_a_band() -> None:
    cygnus, lyra = direction("Cygnus", (305.0, 40.0)), direction("Bootes", (213.9, 19.2))
    in_it, beside = milky_way(np.array([cygnus, lyra]))
    assert in_it > 5 * beside


@pytest.mark.parametrize("away_deg", [15.0, 60.0, 180.0])
def test_is_placed_at_a_longitude_from_the_sun(away_deg: float) -> None:
    for seed in range(4):
        hazard = SkyGlow.placed(away_deg, NOW, np.random.default_rng(seed))
        x, y, _ = NOW.boresight @ ephemeris.FROM_ECLIPTIC
        from_sun = np.degrees(np.arctan2(y, x)) - ephemeris.sun_longitude_deg(hazard.julian_date)
        assert abs((from_sun + 180) % 360 - 180) == pytest.approx(away_deg, abs=0.01)
