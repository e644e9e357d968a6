"""A satellite on its orbit: directions of Earth, Sun and Moon, its attitude, and its scenes.

- Orbit: SGP4 (Vallado and others 2006, AIAA 2006-6753, the package `sgp4`), in the axes of date
  (TEME), transformed to ICRS by the precession of Lieske 1977 (A&A 58, 1). Nutation is neglected:
  at most 20 arcsec, below what any sensor here can measure at the Earth's centre.
- Sun: `hazards.ephemeris`. Moon: the Astronomical Almanac's low-precision formulae (page D22),
  0.3 deg; as seen from the satellite, not from the Earth's centre.
- A mounting is the rotation from body axes to camera axes. Rates are those of the attitude profile.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sgp4.api import SGP4_ERRORS, WGS72, Satrec, jday

from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_matrix,
)
from cubestack.emulator.scene.bodies import DISTURBING, Bodies
from cubestack.emulator.scene.earth import EARTH_RADIUS_KM
from cubestack.emulator.scene.earth_sun import EarthSunScene, Mounting
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.ephemeris import AU_KM, J2000, OBLIQUITY_RAD, heliocentric
from cubestack.emulator.scene.sky import Pose, SkyScene
from cubestack.firmware_model.values import DeclaredValues, vector

GM_KM3_S2 = 398_600.8
"""Gravitational parameter of the Earth in WGS 72, the system of two-line elements."""

DAY_S = 86_400.0
EPOCH_1950 = 2433281.5  # Julian date from which SGP4 counts days

STEP_S = 1e-3
"""Time between two attitudes whose difference is a body rate."""

Vector = NDArray[np.float64]


class Attitude(Protocol):
    """An attitude profile: inertial to body axes."""

    def matrix(self, surroundings: "Surroundings") -> Vector:
        """Rotation (3, 3) from ICRS to body axes."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Position and surroundings of the satellite at a time; directions are ICRS."""

    time_s: float  # time since the orbit's start
    # (3,) relative to the Earth's centre
    position_km: Vector
    velocity_km_s: Vector
    # unit vectors (3,) from the satellite
    sun: Vector
    moon: Vector
    sun_km: float  # distance of the Sun

    @property
    def altitude_km(self) -> float:
        """Altitude above a sphere with the equator's radius."""
        return float(np.linalg.norm(self.position_km)) - EARTH_RADIUS_KM

    @property
    def nadir(self) -> Vector:
        return -self.position_km / np.linalg.norm(self.position_km)

    @property
    def bodies(self) -> Bodies:
        return Bodies(
            nadir=self.nadir,
            sun=self.sun,
            moon=self.moon,
            altitude_km=self.altitude_km,
            sun_km=self.sun_km,
        )

    @property
    def shadow(self) -> float:
        """Share of the Sun's disc that the Earth's disc hides, 0 to 1."""
        return self.bodies.shadow


@dataclass(frozen=True)
class Inertial(DeclaredValues):
    """A fixed attitude, or a constant body rate."""

    error = SceneError

    quaternion: tuple[float, ...] = vector(
        4, (0.0, 0.0, 0.0, 1.0), "at the start, ICRS to body, scalar last"
    )
    rate_deg_s: tuple[float, ...] = vector(3, (0.0, 0.0, 0.0), "body rate", -100, 100)

    def matrix(self, surroundings: Surroundings) -> Vector:
        turned = propagate(self.quaternion, self.rate_deg_s, surroundings.time_s)
        return matrix_from_quaternion(turned)


@dataclass(frozen=True)
class NadirPointing(DeclaredValues):
    """Body z to the Earth's centre, body y opposite to the orbit's normal, then an offset."""

    error = SceneError

    offset_deg: tuple[float, ...] = vector(
        3, (0.0, 0.0, 0.0), "rotation vector in body axes", -360, 360
    )

    def matrix(self, surroundings: Surroundings) -> Vector:
        z = surroundings.nadir
        y = -np.cross(surroundings.position_km, surroundings.velocity_km_s)
        y /= np.linalg.norm(y)
        level = quaternion_from_matrix(np.array([np.cross(y, z), y, z]))
        return matrix_from_quaternion(propagate(level, self.offset_deg, 1.0))


@dataclass(frozen=True)
class Waypoints:
    """Quaternions at times; between two of them the satellite turns at a constant rate."""

    # (time in s, quaternion (4,) ICRS to body), ordered by time, else SceneError
    points: tuple[tuple[float, tuple[float, ...]], ...]

    def __post_init__(self) -> None:
        times = [time_s for time_s, _ in self.points]
        if not times or sorted(set(times)) != times:
            raise SceneError(f"points must be ordered by time, not {times} s")

    def matrix(self, surroundings: Surroundings) -> Vector:
        """Before the first and after the last point, the attitude is constant."""
        now = surroundings.time_s
        begun = [number for number, (time_s, _) in enumerate(self.points) if time_s <= now]
        if not begun or begun[-1] == len(self.points) - 1:
            return matrix_from_quaternion(self.points[begun[-1] if begun else 0][1])
        (since, first), (until, second) = self.points[begun[-1] : begun[-1] + 2]
        first_matrix, second_matrix = map(matrix_from_quaternion, (first, second))
        rate = rate_between(first_matrix, second_matrix, until - since)
        return matrix_from_quaternion(propagate(first, rate, now - since))


def rate_between(first: Vector, second: Vector, seconds: float) -> Vector:
    """Body rate (3,) in deg/s that turns one attitude (3, 3) into another in ``seconds``."""
    x, y, z, w = quaternion_from_matrix(second @ first.T)
    axis = np.array([x, y, z])
    size = float(np.linalg.norm(axis))
    if size == 0:
        return np.zeros(3)
    return np.asarray(-np.degrees(2 * np.arctan2(size, w)) * axis / size / seconds)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A satellite, its attitude, and how its cameras are mounted."""

    satellite: Satrec  # SGP4's elements
    start: datetime  # date and time of virtual time 0, UTC
    attitude: Attitude = field(default_factory=NadirPointing)  # attitude profile
    # mountings of star trackers by device; default along body z
    mountings: dict[str, Mounting] = field(default_factory=dict)
    hazards: bool = True  # whether Earth, Sun and Moon disturb star trackers

    @cached_property
    def _start_days(self) -> tuple[float, float]:
        at = self.start.astimezone(UTC)
        days, part = jday(at.year, at.month, at.day, at.hour, at.minute, at.second)
        return days, part + at.microsecond / 1e6 / DAY_S

    @property
    def period_s(self) -> float:
        """Orbital period from node to node, without the Earth's flattening."""
        return float(2 * np.pi / self.satellite.no_kozai * 60)

    def surroundings(self, time_s: float) -> Surroundings:
        """The surroundings at a time; SceneError if SGP4 reports an error."""
        days, part = self._start_days
        part += time_s / DAY_S
        error, position, velocity = self.satellite.sgp4(days, part)
        if error:
            raise SceneError(f"no orbit {time_s:g} s after the start: {SGP4_ERRORS[error]}")
        date = days + part
        to_icrs = precession(date).T
        place = to_icrs @ np.array(position)
        sun_km = -AU_KM * heliocentric("earth", date) - place
        moon_km = to_icrs @ moon(date) - place
        return Surroundings(
            time_s,
            place,
            to_icrs @ np.array(velocity),
            sun_km / np.linalg.norm(sun_km),
            moon_km / np.linalg.norm(moon_km),
            float(np.linalg.norm(sun_km)),
        )

    def body(self, time_s: float) -> tuple[Vector, Vector]:
        """Rotation (3, 3) from ICRS to body axes, and the body rate (3,) in deg/s."""
        now = self.attitude.matrix(self.surroundings(time_s))
        soon = self.attitude.matrix(self.surroundings(time_s + STEP_S))
        return now, rate_between(now, soon, STEP_S)

    def sky(self, time_s: float, scene: SkyScene, name: str) -> SkyScene:
        """``scene`` with attitude and hazards for the star tracker ``name`` from then on."""
        around = self.surroundings(time_s)
        body, rate = self.body(time_s)
        mounting = self.mountings.get(name, BODY_Z).matrix
        camera = mounting @ body
        pose = Pose(quaternion_from_matrix(camera), mounting @ rate, time_s)
        others = tuple(one for one in scene.hazards if one.name not in DISTURBING)
        return replace(
            scene,
            quaternion=pose.at(0.0),
            rate_deg_s=pose.rate_deg_s,
            poses=(),
            hazards=around.bodies.disturb(others, camera[2]) if self.hazards else others,
        )

    def earth_sun_scene(
        self, time_s: float, scene: EarthSunScene, lasts_s: float = 0.0
    ) -> EarthSunScene:
        """``scene`` with the directions for a satellite's sun and nadir cameras from then on.

        The Earth does not move within a scene, so its direction is that in the middle of
        ``lasts_s``, the time for which the scene is used.
        """
        around = self.surroundings(time_s + lasts_s / 2)
        body, rate = self.body(time_s)
        # Scene axes are the body axes at virtual time 0, extrapolated with the present rate.
        back = matrix_from_quaternion(propagate((0, 0, 0, 1), rate, time_s)).T @ body
        return replace(
            scene,
            nadir=back @ around.nadir,
            sun=back @ around.sun,
            moon=back @ around.moon,
            altitude_km=around.altitude_km,
            rate_deg_s=tuple(rate),
        )


BODY_Z = Mounting((0.0, 0.0, 1.0))


def precession(julian_date: float) -> Vector:
    """Rotation (3, 3) from the axes of J2000 to those of date; Lieske 1977, angles in arcsec."""
    t = (julian_date - J2000) / 36525
    zeta = 2306.2181 * t + 0.30188 * t**2 + 0.017998 * t**3
    z = 2306.2181 * t + 1.09468 * t**2 + 0.018203 * t**3
    theta = 2004.3109 * t - 0.42665 * t**2 - 0.041833 * t**3
    a, b, c = np.radians(np.array([zeta, z, theta]) / 3600)
    tilt = np.array([[np.cos(c), 0, -np.sin(c)], [0, 1, 0], [np.sin(c), 0, np.cos(c)]])
    return np.asarray(_about_z(-b) @ tilt @ _about_z(-a))


def _about_z(angle: float) -> Vector:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])


def moon(julian_date: float) -> Vector:
    """Position (3,) of the Moon relative to the Earth's centre, axes of date, km."""
    t = (julian_date - J2000) / 36525

    def sum_terms(function: Any, rows: Sequence[tuple[float, float, float]]) -> float:
        return float(sum(size * function(np.radians(at + rate * t)) for size, at, rate in rows))

    longitude = 218.32 + 481267.881 * t + sum_terms(np.sin, _LONGITUDE)
    latitude = sum_terms(np.sin, _LATITUDE)
    parallax = 0.9508 + sum_terms(np.cos, _PARALLAX)
    along, above = np.radians([longitude, latitude])
    distance = EARTH_RADIUS_KM / np.sin(np.radians(parallax))
    ecliptic = np.array(
        [np.cos(above) * np.cos(along), np.cos(above) * np.sin(along), np.sin(above)]
    )
    tilt = OBLIQUITY_RAD - np.radians(0.0130042) * t
    cosine, sine = np.cos(tilt), np.sin(tilt)
    return np.asarray(
        distance * np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]) @ ecliptic
    )


# Amplitude, and argument at J2000 with its change per century; all in degrees.
_LONGITUDE = (
    (6.29, 135.0, 477198.87), (-1.27, 259.3, -413335.36), (0.66, 235.7, 890534.22),
    (0.21, 269.9, 954397.74), (-0.19, 357.5, 35999.05), (-0.11, 186.5, 966404.03),
)  # fmt: skip
_LATITUDE = (
    (5.13, 93.3, 483202.02), (0.28, 228.2, 960400.89), (-0.28, 318.3, 6003.15),
    (-0.17, 217.6, -407332.21),
)  # fmt: skip
_PARALLAX = (
    (0.0518, 135.0, 477198.87), (0.0095, 259.3, -413335.36), (0.0078, 235.7, 890534.22),
    (0.0028, 269.9, 954397.74),
)  # fmt: skip


def circular(
    start: datetime, altitude_km: float, inclination_deg: float, node_deg: float, along_deg: float
) -> Satrec:
    """Elements of a circular orbit without drag; ``along_deg`` is from the ascending node."""
    axis = EARTH_RADIUS_KM + altitude_km
    at = start.astimezone(UTC)
    days, part = jday(at.year, at.month, at.day, at.hour, at.minute, at.second)
    satellite = Satrec()
    rate = np.sqrt(GM_KM3_S2 / axis**3) * 60
    inclination, node, along = np.radians([inclination_deg, node_deg, along_deg])
    epoch = days + part - EPOCH_1950
    elements = (0.0, 0.0, 0.0, 0.0, 0.0, inclination, along, rate, node)
    satellite.sgp4init(WGS72, "i", 0, epoch, *elements)
    return satellite
