import numpy as np
import pytest

from cubestack.emulator.scene.hazards import ephemeris
from cubestack.emulator.scene.hazards.contract import direction

DATE = ephemeris.NEW_YEAR_2026


def arcmin(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    return float(np.degrees(2 * np.arcsin(np.linalg.norm(a - b) / 2)) * 60)


@pytest.mark.parametrize(
    ("planet", "ra_deg", "dec_deg", "distance_au", "within_arcmin"),
    [
        # Astrometric places of 2026-01-01 by ERFA's plan94 and epv00, another theory.
        ("mercury", 268.12980, -23.99482, 1.37755, 1),
        ("venus", 279.66459, -23.64471, 1.70995, 1),
        ("mars", 283.48919, -23.75173, 2.41067, 1),
        ("jupiter", 112.72438, 22.03525, 4.24263, 5),
        ("saturn", 357.04624, -3.74321, 9.71509, 8),
        ("uranus", 55.35447, 19.42410, 18.75448, 5),
        ("neptune", 359.74490, -1.56296, 30.05850, 5),
    ],
)
def test_planets_are_where_another_theory_has_them(
    planet: str, ra_deg: float, dec_deg: float, distance_au: float, within_arcmin: float
) -> None:
    place = ephemeris.geocentric(planet, DATE)
    assert arcmin(place, direction("there", (ra_deg, dec_deg))) < within_arcmin
    assert np.linalg.norm(place) == pytest.approx(distance_au, rel=1e-3)


def test_great_conjunction_of_2020() -> None:
    # 2020-12-21 18:20 UT: Jupiter and Saturn 6.1 arcmin apart.
    date = 2459205.264
    apart = arcmin(ephemeris.geocentric("jupiter", date), ephemeris.geocentric("saturn", date))
    assert apart == pytest.approx(6.1, abs=2)


def test_transit_of_venus_in_2012() -> None:
    # 2012-06-06 01:30 UT: 9.2 arcmin from the Sun's centre.
    date = 2456084.5625
    sun = -ephemeris.heliocentric("earth", date)
    assert arcmin(ephemeris.geocentric("venus", date), sun) == pytest.approx(9.2, abs=0.3)


def test_sun_at_the_equinox() -> None:
    # 2026-03-20 14:46 UT it is at 0 deg of date: 26.2 years of precession before that of J2000.
    longitude = ephemeris.sun_longitude_deg(2461120.1153)
    assert (longitude + 26.21 * 50.29 / 3600 + 180) % 360 - 180 == pytest.approx(0, abs=0.01)


def test_velocity_of_the_earth() -> None:
    # Perihelion and aphelion speeds: 30.29 and 29.29 km/s.
    fastest, slowest = (
        np.linalg.norm(ephemeris.earth_velocity_km_s(date)) for date in (2461044.2, 2461228.2)
    )
    assert fastest == pytest.approx(30.29, abs=0.02)
    assert slowest == pytest.approx(29.29, abs=0.02)
    right = [-29.802, -4.947, -2.144]  # ERFA's epv00, 2026-01-01
    np.testing.assert_allclose(ephemeris.earth_velocity_km_s(DATE), right, atol=0.05)
