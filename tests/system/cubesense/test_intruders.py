from dataclasses import replace
from typing import Any

import pytest

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.angles import angles_from_vector, vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget, Reflection
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.clients.cubesense.client import Measurement
from tests.system.conftest import Open

from .conftest import FACING, SUN_DEG, check_right


def measure(ready: Open, scene: Any, camera: Camera) -> Measurement:
    with ready(scene) as opened:
        found: Measurement = opened.client.capture_and_detect(camera)
    return found


@pytest.mark.parametrize(("alpha", "beta"), [(30.0, -40.0), (17.0, 9.0), (-80.0, 20.0)])
def test_moon_does_not_disturb_the_sun_sensor(ready: Open, alpha: float, beta: float) -> None:
    moon = FACING.sun_camera.matrix.T @ vector_from_angles(alpha, beta)
    check_right(measure(ready, replace(FACING, moon=moon), Camera.SUN))


@pytest.mark.parametrize("camera", Camera)
def test_hot_pixels_do_not_change_a_direction(ready: Open, camera: Camera) -> None:
    view = EarthSunView(FACING, FisheyeCondition(hot_pixels=200, hot_pairs=50))
    check_right(measure(ready, view, camera))


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.parametrize(("radius_px", "edges"), [(9.0, 0), (25.0, 2)])
def test_light_beside_the_earth_is_left_out_of_the_limb(
    ready: Open, radius_px: float, edges: int
) -> None:
    (sample,) = LENSES[CameraTarget.NADIR].unproject([(511, 79)])
    light = Reflection(
        CameraTarget.NADIR, *angles_from_vector(sample), radius_px=radius_px, level=200.0
    )
    with ready(FACING) as opened:
        check_right(opened.client.capture_and_detect(Camera.NADIR))
        alone = len(opened.client.edges())
    with ready(replace(FACING, reflections=(light,))) as opened:
        check_right(opened.client.capture_and_detect(Camera.NADIR))
        assert len(opened.client.edges()) == alone + edges
        assert opened.client.details(Camera.NADIR)["Points"] <= alone


@pytest.mark.parametrize(
    ("beta", "level", "expected"),
    [
        (-30.0, 150.0, SUN_DEG),  # below the FPGA's level
        (40.0, 221.0, SUN_DEG),  # later in the picture than the Sun
        (-30.0, 221.0, (0.0, -30.0)),  # earlier: it is taken for the Sun
    ],
)
def test_first_bright_light_in_the_picture_is_taken_for_the_sun(
    ready: Open, beta: float, level: float, expected: tuple[float, float]
) -> None:
    light = Reflection(CameraTarget.SUN, 0.0, beta, radius_px=5.0, level=level)
    check_right(measure(ready, replace(FACING, reflections=(light,)), Camera.SUN), expected)
