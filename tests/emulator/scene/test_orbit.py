from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from sgp4.api import WGS72, Satrec

from cubestack.emulator.scene.attitude import (
    angles_from_vector,
    matrix_from_quaternion,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.bodies import DISTURBING, hidden_share
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Mounting
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.orbit import (
    EARTH_RADIUS_KM,
    Inertial,
    NadirPointing,
    Orbit,
    Waypoints,
    circular,
    moon,
    precession,
    rate_between,
)
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S

START = datetime(2026, 11, 24, 12, tzinfo=UTC)

VALLADO = (
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
"""The first case of Vallado and others 2006 (AIAA 2006-6753)."""


def orbit(**changes: Any) -> Orbit:
    return replace(Orbit(circular(START, 600, 97.8, 20, 180), START), **changes)


def test_orbit_reproduces_the_published_test_case() -> None:
    satellite = Satrec.twoline2rv(*VALLADO, WGS72)
    start = datetime(2000, 6, 27, 18, 50, 19, 733568, tzinfo=UTC)  # day 179.78495062
    around = Orbit(satellite, start).surroundings(0.0)
    of_date = precession(satellite.jdsatepoch + satellite.jdsatepochF) @ around.position_km
    assert of_date == pytest.approx((7022.46529266, -1400.08296755, 0.03995155), abs=1e-2)


def test_precession_turns_the_pole_as_published() -> None:
    """Explanatory Supplement: the pole of 2050 is 1002 arcsec from that of 2000."""
    pole = precession(2451545.0 + 50 * 365.25)[2]
    assert np.degrees(np.arccos(pole[2])) * 3600 == pytest.approx(1002.1, abs=0.5)
    assert precession(2451545.0) == pytest.approx(np.eye(3))


def test_precession_matrix_equals_erfa() -> None:
    """1900-01-01 by ERFA's pmat76."""
    expected = [
        [0.9997029109769726, 0.0223527366106469, 0.0097182792781790],
        [-0.022352736792131, 0.9997501404657165, -0.000108612530292],
        [-0.009718278760616, -0.000108649873838, 0.9999527705112556],
    ]
    np.testing.assert_allclose(precession(2415020.0), expected, atol=2e-9)


def test_moon_terms_are_the_largest_of_the_full_series() -> None:
    """Meeus, Astronomical Algorithms, chapter 47: the same series with more terms and digits."""
    long = {
        "longitude": {
            (0, 0, 1, 0): 6.288774, (2, 0, -1, 0): 1.274027, (2, 0, 0, 0): 0.658314,
            (0, 0, 2, 0): 0.213618, (0, 1, 0, 0): -0.185116, (0, 0, 0, 2): -0.114332,
        },
        "latitude": {
            (0, 0, 0, 1): 5.128122, (0, 0, 1, 1): 0.280602, (0, 0, 1, -1): 0.277693,
            (2, 0, 0, -1): 0.173237,
        },
    }  # fmt: skip

    def theirs(julian_date: float) -> tuple[float, float, float]:
        t = (julian_date - 2451545.0) / 36525
        arguments = (
            297.8501921 + 445267.1114034 * t,
            357.5291092 + 35999.0502909 * t,
            134.9633964 + 477198.8675055 * t,
            93.2720950 + 483202.0175233 * t,
        )

        def total(name: str) -> float:
            return sum(
                size * np.sin(np.radians(np.dot(factors, arguments)))
                for factors, size in long[name].items()
            )

        d, _, m, _ = np.radians(arguments)
        distance_km = 385000.56 - 20905.355 * np.cos(m) - 3699.111 * np.cos(2 * d - m)
        distance_km -= 2955.968 * np.cos(2 * d) + 569.925 * np.cos(2 * m)
        longitude = 218.3164477 + 481267.88123421 * t + total("longitude")
        return longitude, total("latitude"), distance_km

    dates = 2451545.0 + np.linspace(-18_000, 18_000, 400)
    longitude, latitude, distance_km = np.transpose([theirs(date) for date in dates])
    tilt = np.radians(23.4392911 - 0.0130042 * (dates - 2451545.0) / 36525)
    x, y, z = np.transpose([moon(date) for date in dates])
    y, z = y * np.cos(tilt) + z * np.sin(tilt), z * np.cos(tilt) - y * np.sin(tilt)
    along = np.degrees(np.arctan2(y, x)) - longitude
    above = np.degrees(np.arctan2(z, np.hypot(x, y))) - latitude
    farther = np.sqrt(x**2 + y**2 + z**2) / distance_km - 1
    # What the digits and terms that are left out make.
    for off, rms in (((along + 180) % 360 - 180, 0.0078), (above, 0.00365), (farther, 0.00054)):
        assert np.sqrt(np.mean(off**2)) < rms


def test_moon_distance_varies_in_phase_with_its_arguments() -> None:
    """By the angles of the long series, which are rounded to 0.1 deg here."""
    dates = 2451545.0 + np.linspace(-18_000, 18_000, 400)
    t = (dates - 2451545.0) / 36525
    elongation, anomaly = 297.8501921 + 445267.1114034 * t, 134.9633964 + 477198.8675055 * t
    window = np.hanning(len(dates))  # keeps the terms apart
    nearness = window / [np.linalg.norm(moon(date)) for date in dates]
    for angle in (anomaly, 2 * elongation - anomaly, 2 * elongation, 2 * anomaly):
        late_deg = np.degrees(np.angle(nearness @ np.exp(1j * np.radians(angle))))
        assert late_deg == pytest.approx(0.0, abs=0.06)


def test_moon_position_matches_a_textbook_example() -> None:
    """Meeus, Astronomical Algorithms, example 47.a: 1992 April 12, 0 h TD."""
    tilt = np.radians(23.440636)
    x, y, z = moon(2448724.5)
    ecliptic = np.array(
        [x, y * np.cos(tilt) + z * np.sin(tilt), z * np.cos(tilt) - y * np.sin(tilt)]
    )
    along, above = np.radians([133.162655, -3.229126])
    theirs = np.array([np.cos(above) * np.cos(along), np.cos(above) * np.sin(along), np.sin(above)])
    distance = float(np.linalg.norm(ecliptic))
    assert np.degrees(np.arccos(theirs @ ecliptic / distance)) < 0.3
    assert distance == pytest.approx(368_409.7, rel=0.003)


@pytest.mark.parametrize(("when", "dec_deg"), [((3, 20, 14, 46), 0.0), ((6, 21, 8, 24), 23.44)])
def test_sun_is_on_the_equator_at_an_equinox(when: Any, dec_deg: float) -> None:
    """Equinox and solstice of 2026, by the almanacs; in the axes of date."""
    start = datetime(2026, *when, tzinfo=UTC)
    around = orbit(start=start).surroundings(0.0)
    sun = precession(2461119.5 + (start - datetime(2026, 3, 20, tzinfo=UTC)).days) @ around.sun
    assert np.degrees(np.arcsin(sun[2])) == pytest.approx(dec_deg, abs=0.02)


def test_circular_orbit_keeps_its_altitude_and_repeats_after_its_period() -> None:
    own = orbit()
    heights = [own.surroundings(at).altitude_km for at in np.linspace(0, own.period_s, 50)]
    assert heights == pytest.approx([600] * 50, abs=20)  # the Earth is no ball
    axis = EARTH_RADIUS_KM + 600
    assert own.period_s == pytest.approx(2 * np.pi * np.sqrt(axis**3 / 398_600.8), rel=1e-6)
    first, again = own.surroundings(0.0), own.surroundings(own.period_s)
    assert first.nadir @ again.nadir == pytest.approx(1.0, abs=1e-4)


def test_earth_shadow_lasts_as_geometry_predicts() -> None:
    """A cylinder behind the Earth: half the shadow's arc, for a Sun that is b from the orbit."""
    own = orbit()
    times = np.arange(0, own.period_s, 2.0)
    around = [own.surroundings(at) for at in times]
    normal = np.cross(around[0].position_km, around[0].velocity_km_s)
    sine = float(around[0].sun @ normal / np.linalg.norm(normal))
    height = around[0].altitude_km
    ratio = np.sqrt(height**2 + 2 * EARTH_RADIUS_KM * height) / (EARTH_RADIUS_KM + height)
    expected = np.arccos(ratio / np.sqrt(1 - sine**2)) / np.pi
    found = np.mean([one.shadow for one in around])
    assert found == pytest.approx(expected, abs=0.005)
    assert any(0 < one.shadow < 1 for one in around)


@pytest.mark.parametrize(
    ("apart", "share"), [(3.0, 0.0), (3.1, 0.0), (1.0, 1.0), (0.0, 1.0), (2.0, None)]
)
def test_hidden_share_of_a_disc_matches_sampling(apart: float, share: float | None) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (200_000, 2))
    points = points[np.hypot(*points.T) < 1]
    counted = np.mean(np.hypot(points[:, 0] - apart, points[:, 1]) < 2)
    assert hidden_share(1.0, 2.0, apart) == pytest.approx(counted, abs=5e-3)
    assert share is None or hidden_share(1.0, 2.0, apart) == share


@pytest.mark.parametrize("seed", range(5))
def test_rate_between_two_attitudes_propagates_one_to_the_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, rate = rng.standard_normal(4), rng.uniform(-5, 5, 3)
    second = propagate(first, rate, 7.0)
    found = rate_between(matrix_from_quaternion(first), matrix_from_quaternion(second), 7.0)
    assert found == pytest.approx(rate, abs=1e-9)
    assert rate_between(np.eye(3), np.eye(3), 1.0) == pytest.approx(np.zeros(3))


def test_nadir_pointing_faces_nadir_and_rotates_once_per_orbit() -> None:
    own = orbit(attitude=NadirPointing())
    body, rate = own.body(1000.0)
    around = own.surroundings(1000.0)
    assert body @ around.nadir == pytest.approx((0, 0, 1), abs=1e-9)
    assert body @ around.velocity_km_s / 7.5 == pytest.approx((1, 0, 0), abs=0.02)
    assert rate == pytest.approx((0, -360 / own.period_s, 0), abs=2e-4)
    off, _ = replace(own, attitude=NadirPointing((0.0, 5.0, 0.0))).body(1000.0)
    angle = np.degrees(np.arccos((off @ around.nadir)[2]))
    assert angle == pytest.approx(5.0)


def test_waypoints_are_met_with_constant_rate_between() -> None:
    first, second = (tuple(quaternion_from_pointing(ra, 10, 0).tolist()) for ra in (20, 60))
    profile = Waypoints(((100.0, first), (200.0, second)))
    own = orbit(attitude=profile)
    for at, expected in ((0, first), (100, first), (200, second), (300, second)):
        assert own.body(at)[0] == pytest.approx(matrix_from_quaternion(expected), abs=1e-9)
    rates = [own.body(at)[1] for at in (101.0, 150.0, 199.0)]
    assert rates[1:] == [pytest.approx(rates[0], abs=1e-6)] * 2
    assert np.linalg.norm(rates[0]) * 100 == pytest.approx(40.0)  # about the pole
    with pytest.raises(SceneError, match="points must be ordered by time"):
        Waypoints(((2.0, first), (1.0, second)))


@pytest.mark.parametrize("at", [0.0, 0.5, 30.0, 2000.0])
def test_sky_camera_sees_the_attitude_of_its_mounting(at: float) -> None:
    mounting = Mounting((0.0, -1.0, 0.0))
    own = orbit(mountings={"camera": mounting})
    scene = own.sky(at, SkyScene([0, 0, 0, 1], seed=5, epoch=2026.0), "camera")
    assert (scene.seed, scene.epoch) == (5, 2026.0)
    for later in (at, at + 0.7):
        expected = mounting.matrix @ own.body(later)[0]
        found = matrix_from_quaternion(scene.truth(round(later * PS_PER_S)))
        assert found == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("at", [0.0, 30.0, 2000.0])
def test_satellite_cameras_see_earth_and_sun(at: float) -> None:
    own = orbit(attitude=Inertial(rate_deg_s=(0.3, -0.2, 0.1)))
    scene = own.earth_sun_scene(at, EarthSunScene(seed=3))
    assert scene.seed == 3
    for later in (at, at + 0.9):
        around, time_ps = own.surroundings(later), round(later * PS_PER_S)
        body, _ = own.body(later)
        for target, mounting, direction in (
            (CameraTarget.SUN, scene.sun_camera, around.sun),
            (CameraTarget.NADIR, scene.nadir_camera, around.nadir),
        ):
            truth = scene.truth(target, time_ps)
            expected = mounting.matrix @ body @ direction
            assert truth.vector == pytest.approx(expected, abs=2e-3 if later > at else 1e-9)
            assert (truth.alpha_deg, truth.beta_deg) == angles_from_vector(truth.vector)
    assert scene.altitude_km == pytest.approx(own.surroundings(at).altitude_km)
    assert scene.hidden(scene.sun) == (own.surroundings(at).shadow > 0.5)


def test_orbit_adds_only_nearby_bodies_to_the_sky() -> None:
    own = orbit()
    seen = set()
    for direction in ((0, 0, 1), (0, 0, -1), (0, -1, 0), (1, 0, 0)):
        turned = replace(own, mountings={"camera": Mounting(direction, (0.6, 0.8, 0.0))})
        for at in np.arange(0, 5800, 600.0):
            around = own.surroundings(at)
            camera = turned.mountings["camera"].matrix @ own.body(at)[0]
            names = {h.name for h in turned.sky(at, SkyScene([0, 0, 0, 1]), "camera").hazards}
            seen |= names
            sun_deg = np.degrees(np.arccos(np.clip(camera[2] @ around.sun, -1, 1)))
            glares = around.shadow < 1 and sun_deg < DISTURBING["sun-glare"]
            assert ("sun-glare" in names) == glares
    assert seen >= {"earth-limb", "sun-glare"}
    assert own.sky(0.0, SkyScene([0, 0, 0, 1]), "camera").hazards
    assert not replace(own, hazards=False).sky(0.0, SkyScene([0, 0, 0, 1]), "camera").hazards


def test_reports_decayed_elements() -> None:
    lines = (
        "1 28350U 04020A   06167.21788666  .16154492  76267-5  18678-3 0  8894",
        "2 28350  64.9977 345.6130 0024870 260.7578  99.9590 16.47856722116490",
    )  # decays within days: Vallado and others 2006
    own = Orbit(Satrec.twoline2rv(*lines), datetime(2006, 6, 16, tzinfo=UTC))
    with pytest.raises(SceneError, match=r"no orbit 5e\+06 s after the start: "):
        own.surroundings(5e6)
