from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.emulator.scene.orbit import Inertial, NadirPointing, Waypoints
from cubestack.emulator.scene.orbit_file import load_orbit

from ..camera.conftest import check_refused, save
from .test_orbit import VALLADO

START = "start = 2026-11-24T12:00:00Z\n"
CIRCLE = "[circular]\naltitude_km = 600\ninclination_deg = 97.8\nnode_deg = 20\n"
TLE = f"tle = [{VALLADO[0]!r}, {VALLADO[1]!r}]\n"


def load(folder: Path, text: str):
    return load_orbit(save(folder, text))


def test_minimal_orbit_file_loads_with_defaults(tmp_path: Path) -> None:
    orbit = load(tmp_path, START + CIRCLE)
    assert orbit.surroundings(0.0).altitude_km == pytest.approx(600, abs=20)
    assert isinstance(orbit.attitude, NadirPointing)
    assert (orbit.mountings, orbit.hazards) == ({}, True)


def test_orbit_file_loads_two_line_elements(tmp_path: Path) -> None:
    orbit = load(tmp_path, START + TLE)
    assert orbit.satellite.satnum == 5
    assert orbit.period_s == pytest.approx(86400 / 10.82419157, rel=1e-3)


def test_orbit_file_accepts_each_attitude_kind(tmp_path: Path) -> None:
    text = START + CIRCLE
    found = load(tmp_path, text + '[attitude]\nkind = "nadir"\noffset_deg = [1, 2, 3]\n')
    assert found.attitude == NadirPointing((1.0, 2.0, 3.0))
    pose = "ra_deg = 10\ndec_deg = 20\nrate_deg_s = [0, 0.5, 0]\n"
    found = load(tmp_path, f'{text}[attitude]\nkind = "inertial"\n{pose}')
    assert isinstance(found.attitude, Inertial)
    expected = matrix_from_quaternion(quaternion_from_pointing(10, 20, 0))
    np.testing.assert_allclose(found.body(0.0)[0], expected, atol=1e-12)
    assert found.body(0.0)[1] == pytest.approx((0, 0.5, 0), abs=1e-6)
    points = "".join(
        f"[[attitude.points]]\nat_s = {at}\nquaternion = [0, 0, {at}, 1]\n" for at in (1, 2)
    )
    found = load(tmp_path, f'{text}[attitude]\nkind = "waypoints"\n{points}')
    assert found.attitude == Waypoints(((1.0, (0, 0, 1, 1)), (2.0, (0, 0, 2, 1))))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (CIRCLE, "needs the key start"),
        (START, "needs either tle, or the table circular"),
        (START + TLE + CIRCLE, "needs either tle, or the table circular"),
        ("start = 2026-11-24T12:00:00\n" + CIRCLE, "start must have a time zone"),
        ("start = 1900-01-01T00:00:00Z\n" + CIRCLE, "start must be in 1958..2049, not 1900"),
        ("start = 5\n" + CIRCLE, "start must be a date and time"),
        (START + CIRCLE.replace("600", "100"), "circular: altitude_km must be 160 to 40000"),
        (START + "[circular]\naltitude_km = 500\n", "needs the keys inclination_deg, node_deg"),
        (START + "tle = ['1']\n", "tle must be a list of 2 texts"),
        (START + TLE.replace("4753", "4752"), "tle line 1 must end in its check sum 3, not 2"),
        (START + TLE.replace("2 00005", "2 0005"), "tle line 2 must have 69 characters"),
        (START + CIRCLE + '[attitude]\nkind = "sun"\n', "attitude: kind must be one of nadir"),
        (START + CIRCLE + '[attitude]\nkind = "inertial"\n', "needs either quaternion, or ra_deg"),
        (START + CIRCLE + '[attitude]\nkind = "waypoints"\n', "attitude: needs the key points"),
        (START + CIRCLE + "[mountings.star]\nright = [1, 0, 0]\n", "needs the key boresight"),
        (START + CIRCLE + "[mountings.star]\nboresight = [1, 0, 0]\n", "right must not be along"),
        (START + "speed = 5\n", "unknown key 'speed'"),
        ("not toml", "is not a TOML file"),
    ],
)
def test_errors_are_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    check_refused(load_orbit, save(tmp_path, text), complaint)
    check_refused(load_orbit, tmp_path / "none.toml", "can not be read")
