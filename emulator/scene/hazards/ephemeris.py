"""Approximate positions of the planets, the Earth and the Sun in the years 1800 to 2050.

E. M. Standish, Keplerian elements for approximate positions of the major planets (JPL), table 1:
errors of the heliocentric longitudes are 15 to 50 arcsec up to Mars, 400 and 600 for Jupiter and
Saturn. Axes are ICRS, distances astronomical units, dates Julian. Neglected: the seconds between
the time scales, and the distance between the Earth and its barycentre with the Moon.
"""

import numpy as np
from numpy.typing import NDArray

J2000 = 2451545.0
NEW_YEAR_2026 = 2461041.5
FIRST_DATE, LAST_DATE = 2378496.5, 2469807.5
"""Validity of the elements: 1800 to 2050."""

AU_KM = 149_597_870.7
DAY_S = 86400.0
OBLIQUITY_RAD = np.radians(23.43928)
LIGHT_DAYS_PER_AU = 499.004784 / DAY_S

#: Axis (au), eccentricity, inclination, mean longitude, longitudes of perihelion and node (deg),
#: each at J2000 and its change per century.
ELEMENTS = {
    "mercury": (
        (0.38709927, 0.20563593, 7.00497902, 252.25032350, 77.45779628, 48.33076593),
        (0.00000037, 0.00001906, -0.00594749, 149472.67411175, 0.16047689, -0.12534081),
    ),
    "venus": (
        (0.72333566, 0.00677672, 3.39467605, 181.97909950, 131.60246718, 76.67984255),
        (0.00000390, -0.00004107, -0.00078890, 58517.81538729, 0.00268329, -0.27769418),
    ),
    "earth": (
        (1.00000261, 0.01671123, -0.00001531, 100.46457166, 102.93768193, 0.0),
        (0.00000562, -0.00004392, -0.01294668, 35999.37244981, 0.32327364, 0.0),
    ),
    "mars": (
        (1.52371034, 0.09339410, 1.84969142, -4.55343205, -23.94362959, 49.55953891),
        (0.00001847, 0.00007882, -0.00813131, 19140.30268499, 0.44441088, -0.29257343),
    ),
    "jupiter": (
        (5.20288700, 0.04838624, 1.30439695, 34.39644051, 14.72847983, 100.47390909),
        (-0.00011607, -0.00013253, -0.00183714, 3034.74612775, 0.21252668, 0.20469106),
    ),
    "saturn": (
        (9.53667594, 0.05386179, 2.48599187, 49.95424423, 92.59887831, 113.66242448),
        (-0.00125060, -0.00050991, 0.00193609, 1222.49362201, -0.41897216, -0.28867794),
    ),
    "uranus": (
        (19.18916464, 0.04725744, 0.77263783, 313.23810451, 170.95427630, 74.01692503),
        (-0.00196176, -0.00004397, -0.00242939, 428.48202785, 0.40805281, 0.04240589),
    ),
    "neptune": (
        (30.06992276, 0.00859048, 1.77004347, -55.12002969, 44.96476227, 131.78422574),
        (0.00026291, 0.00005105, 0.00035372, 218.45945325, -0.32241464, -0.00508664),
    ),
}

Vector = NDArray[np.float64]


def heliocentric(planet: str, julian_date: float) -> Vector:
    """Position (3,) of a planet relative to the Sun, ICRS, au."""
    start, change = np.array(ELEMENTS[planet])
    axis, eccentricity, *angles = start + change * (julian_date - J2000) / 36525
    inclination, longitude, perihelion, node = np.radians(angles)
    mean = np.remainder(longitude - perihelion + np.pi, 2 * np.pi) - np.pi
    anomaly = mean
    for _ in range(8):  # Newton's method; enough for these eccentricities
        excess = anomaly - eccentricity * np.sin(anomaly) - mean
        anomaly -= excess / (1 - eccentricity * np.cos(anomaly))
    in_orbit = axis * np.array(
        [np.cos(anomaly) - eccentricity, np.sqrt(1 - eccentricity**2) * np.sin(anomaly), 0]
    )
    turned = _about_z(node) @ _rotation_about_x(inclination) @ _about_z(perihelion - node)
    return np.asarray(FROM_ECLIPTIC @ turned @ in_orbit, np.float64)


def geocentric(planet: str, julian_date: float) -> Vector:
    """Position (3,) of a planet relative to the Earth when its light left: ICRS, au."""
    earth = heliocentric("earth", julian_date)
    there = heliocentric(planet, julian_date) - earth
    sent = julian_date - LIGHT_DAYS_PER_AU * float(np.linalg.norm(there))
    return heliocentric(planet, sent) - earth


def sun_longitude_deg(julian_date: float) -> float:
    """Ecliptic longitude of the Sun seen from the Earth, 0 to 360, equinox J2000."""
    x, y, _ = -heliocentric("earth", julian_date) @ FROM_ECLIPTIC
    return float(np.degrees(np.arctan2(y, x)) % 360)


def earth_velocity_km_s(julian_date: float) -> Vector:
    """Velocity (3,) of the Earth around the Sun, ICRS, km/s."""
    half = 0.05  # days; the curvature of the orbit is below 1e-7
    later, before = (heliocentric("earth", julian_date + dt) for dt in (half, -half))
    return (later - before) * (AU_KM / (2 * half * DAY_S))


def _about_z(angle: float) -> Vector:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _rotation_about_x(angle: float) -> Vector:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


FROM_ECLIPTIC = _rotation_about_x(OBLIQUITY_RAD)
"""Rotation (3, 3) from the ecliptic and equinox of J2000 to ICRS axes."""
