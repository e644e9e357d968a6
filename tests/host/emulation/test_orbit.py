import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.common.view import View
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import (
    angles_from_vector,
    attitude_error_deg,
    quaternion_from_matrix,
)
from cubestack.emulator.scene.earth_sun import CameraTarget, Mounting
from cubestack.emulator.scene.orbit import Inertial
from cubestack.emulator.scene.orbit_file import load_orbit
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.orbit import follow

ORBIT = Path(__file__).parents[3] / "examples" / "orbits" / "sun-synchronous.toml"

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def satellite() -> Iterator[tuple[Any, Any, Any]]:
    """An orbit with a star tracker and a sun and nadir sensor."""
    orbit = load_orbit(ORBIT)
    with (
        open_device("cubestar", profile="extended") as star,
        open_device("cubesense", beside=star, profile="extended") as sense,
    ):
        follow(orbit, [star, sense])
        yield orbit, star, sense


def scene_of(device: Any) -> Any:
    return device.scene.scene if isinstance(device.scene, View) else device.scene


@pytest.mark.slow
def test_scenes_follow_the_orbit(satellite: tuple[Any, Any, Any]) -> None:
    orbit, star, sense = satellite
    assert "an orbit moves" in star.follows
    # Between whole seconds the rate of the last holds on, and the orbit bends.
    for until in (0.0, 1.55, 10.0, 100.2):
        star.wait(until - star.time_s)
        time_ps = round(until * PS_PER_S)
        camera = orbit.mountings["cubestar"].matrix @ orbit.body(until)[0]
        found = scene_of(star).truth(time_ps)
        assert max(map(abs, attitude_error_deg(found, quaternion_from_matrix(camera)))) < 2e-3
        truth = scene_of(sense).truth(CameraTarget.NADIR, time_ps)
        assert truth.vector == pytest.approx((0, 0, 1), abs=1e-4)


@pytest.mark.slow
def test_measurements_match_the_orbit(satellite: tuple[Any, Any, Any]) -> None:
    orbit, star, sense = satellite
    star.wait(60.0)
    assert orbit.surroundings(60.0).shadow == 0
    star.client.capture_and_process()
    found = star.client.attitude()
    assert found.valid
    camera = orbit.mountings["cubestar"].matrix @ orbit.body(found.image_time_s)[0]
    cross, roll = attitude_error_deg(found.quaternion, quaternion_from_matrix(camera))
    assert cross < 0.01
    assert abs(roll) < 0.05
    for which, direction in ((Camera.SUN, "sun"), (Camera.NADIR, "nadir")):
        measured = sense.client.capture_and_detect(which)
        assert measured.detect == DetectResult.SUCCESS
        around, body = orbit.surroundings(sense.time_s), orbit.body(sense.time_s)[0]
        scene = scene_of(sense)
        mounting = scene.sun_camera if which == Camera.SUN else scene.nadir_camera
        expected = mounting.matrix @ body @ getattr(around, direction)
        angles = measured.alpha_deg, measured.beta_deg
        assert angles == pytest.approx(angles_from_vector(expected), abs=0.2)


def test_sun_is_not_found_in_shadow() -> None:
    orbit = load_orbit(ORBIT)
    dark = next(at for at in range(0, 5800, 10) if orbit.surroundings(at).shadow == 1)
    # Turned so that the sun camera would look straight at it all the time.
    to_sun = Mounting(-orbit.surroundings(dark).sun).matrix
    attitude = Inertial(tuple(quaternion_from_matrix(to_sun)))
    start = orbit.start + timedelta(seconds=dark - 60)
    orbit = replace(orbit, start=start, attitude=attitude, mountings={})
    with open_device("cubesense", profile="extended") as sense:
        follow(orbit, [sense])
        assert sense.client.capture_and_detect(Camera.SUN).detect == DetectResult.SUCCESS
        sense.wait(70 - sense.time_s)
        assert sense.client.capture_and_detect(Camera.SUN).detect != DetectResult.SUCCESS


def test_emulate_rejects_invalid_orbits(run: Any, tmp_path: Path) -> None:
    bad = tmp_path / "orbit.toml"
    bad.write_text(re.sub("600.0", "60.0", ORBIT.read_text()))
    outcome = run("emulate", "cubestar", "--orbit", bad, "--tcp", "0")
    assert outcome.code == 2
    assert outcome.line == (
        f"cubestack emulate: {bad}: circular: altitude_km must be 160 to 40000 km, not 60.0"
    )
    outcome = run("emulate", "cubesense", "--orbit", ORBIT, "--tcp", "0")
    assert "mountings: 'cubestar' is not on board; there are cubesense" in outcome.line
