"""The ball of the nadir sensor's bench, against its geometry."""

import numpy as np
import pytest

from cubestack.emulator.scene.ball import ball_scene
from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.file import SceneError


def angles(**place: object) -> tuple[float, float]:
    truth = ball_scene(**place).truth(CameraTarget.NADIR, 0)  # type: ignore[arg-type]
    return truth.alpha_deg, truth.beta_deg


def test_it_is_as_large_as_the_earth_and_where_the_stage_says() -> None:
    assert angular_radius_deg(ball_scene().altitude_km) == pytest.approx(63.5, abs=0.05)
    assert angles(angle_deg=(12, -25)) == pytest.approx((12, -25))
    near = ball_scene(radius_mm=100, distance_mm=100)
    assert angular_radius_deg(near.altitude_km) == pytest.approx(30)


def test_an_optic_point_that_is_not_in_the_axis() -> None:
    # In the plane: the ball's centre is 335.2 mm from the axis, the camera 10 mm before it.
    along, across = 335.2 * np.cos(np.radians(30)) - 10, 335.2 * np.sin(np.radians(30))
    assert angles(angle_deg=(30, 0), offset_mm=(0, 0, 10)) == pytest.approx(
        (np.degrees(np.arctan2(across, along)), 0)
    )
    moved = ball_scene((30, 0), offset_mm=(0, 0, 10))
    assert np.sin(np.radians(angular_radius_deg(moved.altitude_km))) == pytest.approx(
        300 / np.hypot(along, across)
    )
    assert angles(angle_deg=(0, 0), offset_mm=(5, 0, 0))[0] < 0
    assert angles(angle_deg=(30, 0), offset_mm=(0, 0, 1))[0] - 30 == pytest.approx(0.085, abs=1e-3)


def test_it_is_lit_and_nothing_glows() -> None:
    scene = ball_scene((10, 0))
    assert scene.glow_km == scene.unevenness == 0
    np.testing.assert_allclose(scene.sun, -np.asarray(scene.nadir))
    assert ball_scene(unevenness=0.1, seed=3).earth.unevenness == 0.1


def test_rejects_impossible_places() -> None:
    with pytest.raises(SceneError, match="distance_mm must be above 0 mm, not 0"):
        ball_scene(distance_mm=0)
    with pytest.raises(SceneError, match="offset_mm must leave the camera outside the ball"):
        ball_scene(offset_mm=(0, 0, 36))
