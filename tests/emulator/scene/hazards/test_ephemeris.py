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
def test_planet_positions_match_another_theory(
    planet: str, ra_deg: float, dec_deg: float, distance_au: float, within_arcmin: float
) -> None:
    place = ephemeris.geocentric(planet, DATE)
    assert arcmin(place, direction("there", (ra_deg, dec_deg))) < within_arcmin
    assert np.linalg.norm(place) == pytest.approx(distance_au, rel=1e-3)


def test_ephemeris_places_jupiter_and_saturn_6_arcmin_apart_in_2020() -> None:
    # 2020-12-21 18:20 UT: Jupiter and Saturn 6.1 arcmin apart.
    date = 2459205.264
    apart = arcmin(ephemeris.geocentric("jupiter", date), ephemeris.geocentric("saturn", date))
    assert apart == pytest.approx(6.1, abs=2)


def test_ephemeris_places_venus_9_arcmin_from_the_sun_in_its_transit() -> None:
    # 2012-06-06 01:30 UT: 9.2 arcmin from the Sun's centre.
    date = 2456084.5625
    sun = -ephemeris.heliocentric("earth", date)
    assert arcmin(ephemeris.geocentric("venus", date), sun) == pytest.approx(9.2, abs=0.3)


def test_sun_longitude_is_0_at_the_equinox() -> None:
    # 2026-03-20 14:46 UT it is at 0 deg of date: 26.2 years of precession before that of J2000.
    longitude = ephemeris.sun_longitude_deg(2461120.1153)
    assert (longitude + 26.21 * 50.29 / 3600 + 180) % 360 - 180 == pytest.approx(0, abs=0.01)


def test_earth_velocity_matches_published_values() -> None:
    # Perihelion and aphelion speeds: 30.29 and 29.29 km/s.
    velocities = [ephemeris.earth_velocity_km_s(date) for date in (2461044.2, 2461228.2)]
    assert np.linalg.norm(velocities, axis=1) == pytest.approx([30.29, 29.29], abs=0.02)
    right = [-29.802, -4.947, -2.144]  # ERFA's epv00, 2026-01-01
    np.testing.assert_allclose(ephemeris.earth_velocity_km_s(DATE), right, atol=0.05)


#: The error in arcseconds that a planet's places may have, and heliocentric ones by ERFA's plan94,
#: another theory, on 1850-01-29, 1950-01-01 and 2047-10-15.
PLACES = """\
mercury 15 0.25680 -0.28910 -0.18109 0.32088 0.09952 0.01983 0.27939 0.15691 0.05489
venus 20 -0.27662 -0.61812 -0.26024 0.09428 0.65330 0.28783 0.27846 0.61308 0.25830
earth 15 -0.21100 0.88098 0.38230 -0.18271 0.88638 0.38441 0.91844 0.35568 0.15415
mars 25 -0.14098 1.43238 0.66076 -1.39554 0.80849 0.40870 -1.36055 0.85436 0.42851
jupiter 400 -5.23700 1.23151 0.65591 3.40640 -3.42580 -1.55161 3.36935 3.40893 1.37920
saturn 560 9.29609 1.64610 0.28086 -9.00684 2.17002 1.28327 0.72596 -9.24939 -3.85197
uranus 70 17.69941 8.42046 3.43699 -1.23491 17.31054 7.59939 -16.81213 6.54441 3.10412
neptune 45 27.44139 -10.91034 -5.14855 -29.09373 -8.04979 -2.57073 19.40787 21.11271 8.15846
"""


@pytest.mark.parametrize("line", PLACES.splitlines(), ids=lambda line: line.split()[0])
def test_planet_positions_are_accurate_over_two_centuries(line: str) -> None:
    planet, within_arcsec, *places = line.split()
    there = np.reshape([float(number) for number in places], (3, 3))
    dates = (2396758.5, 2433282.5, 2469000.5)
    found = np.array([ephemeris.heliocentric(planet, at) for at in dates])
    off = np.linalg.norm(found - there, axis=1) / np.linalg.norm(there, axis=1)
    assert np.degrees(np.sqrt(np.mean(off**2))) * 3600 < float(within_arcsec)


@pytest.mark.parametrize(
    ("planet", "perihelion_deg", "node_deg"),
    [("jupiter", 14.3313, 100.4644), ("saturn", 93.0568, 113.6655)],
)
def test_giant_planet_elements_are_near_published_mean_elements(
    planet: str, perihelion_deg: float, node_deg: float
) -> None:
    """Meeus, Astronomical Algorithms, table 31.A: J2000; these are fitted to two centuries."""
    *_, perihelion, node = ephemeris.ELEMENTS[planet][0]
    assert perihelion == pytest.approx(perihelion_deg, abs=0.5)
    assert node == pytest.approx(node_deg, abs=0.05)


def test_elliptical_orbit_obeys_keplers_laws() -> None:
    """Equal areas in equal times, the focus in the Sun, whatever the eccentricity."""
    for planet in ephemeris.ELEMENTS:
        axis, eccentricity = ephemeris.ELEMENTS[planet][0][:2]
        days = 365.25 * axis**1.5 * np.linspace(0, 1, 41)
        places = np.array([ephemeris.heliocentric(planet, ephemeris.J2000 + d) for d in days])
        areas = np.linalg.norm(np.cross(places[:-1], places[1:]), axis=1) / 2
        halves = areas.reshape(2, 20).sum(axis=1)
        distances = np.linalg.norm(places, axis=1)
        assert distances.max() < axis * (1 + eccentricity) * 1.005
        assert distances.min() > axis * (1 - eccentricity) * 0.995
        assert halves[0] == pytest.approx(halves[1], rel=0.01)
