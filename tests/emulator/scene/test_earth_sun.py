import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Mounting, ball_scene
from cubestack.emulator.scene.file import SceneError

SUN, NADIR = CameraTarget.SUN, CameraTarget.NADIR
S = 10**12


def angles(scene: EarthSunScene, camera: CameraTarget) -> tuple[float, float]:
    truth = scene.truth(camera, 0)
    return truth.alpha_deg, truth.beta_deg


def test_both_cameras_look_at_their_object_by_default() -> None:
    for camera in CameraTarget:
        truth = EarthSunScene().truth(camera, 0)
        np.testing.assert_allclose(truth.vector, [0, 0, 1], atol=1e-15)
        assert (truth.alpha_deg, truth.beta_deg) == pytest.approx((0, 0), abs=1e-12)
        assert truth.visible


def test_mounting_is_a_rotation_to_the_image_axes() -> None:
    matrix = Mounting([0, 2.0, 0], [3.0, 1.0, 0]).matrix
    np.testing.assert_allclose(matrix @ [0, 1, 0], [0, 0, 1], atol=1e-15)  # boresight
    np.testing.assert_allclose(matrix @ [1, 0, 0], [1, 0, 0], atol=1e-15)  # right
    np.testing.assert_allclose(matrix @ [0, 0, -1], [0, 1, 0], atol=1e-15)  # so that is down
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_alpha_is_to_the_right_and_beta_down() -> None:
    # Nadir camera along +z, its right side +x: so down is +y.
    scene = EarthSunScene(nadir=[np.sin(0.5), 0, np.cos(0.5)])
    assert angles(scene, NADIR) == pytest.approx((np.degrees(0.5), 0))
    # Sun camera along -z, its right side +x: so down is -y.
    scene = EarthSunScene(sun=[0, -np.sin(0.5), -np.cos(0.5)])
    assert angles(scene, SUN) == pytest.approx((0, np.degrees(0.5)))
    vector = EarthSunScene.facing(nadir_deg=(30, -40)).truth(NADIR, 0).vector
    assert np.degrees(np.arccos(vector[2])) == pytest.approx(50)
    assert vector[0] / vector[1] == pytest.approx(30 / -40)


def test_facing_matches_the_truth_for_any_mounting() -> None:
    mounting = Mounting([1, 2, 3], [0, 1, 0])
    scene = EarthSunScene.facing((20, -10), (-5, 60), sun_camera=mounting, altitude_km=400)
    assert angles(scene, SUN) == pytest.approx((20, -10))
    assert angles(scene, NADIR) == pytest.approx((-5, 60))
    assert scene.altitude_km == 400


def test_truth_follows_the_body_rate() -> None:
    rate = np.array([0.3, -0.2, 1.0])
    scene = EarthSunScene.facing(nadir_deg=(10, 20), rate_deg_s=rate)
    before = scene.truth(NADIR, 0).vector
    # The satellite turns by the rate, so what it sees turns the other way.
    expected = Rotation.from_rotvec(np.radians(rate * 4)).inv().apply(before)
    np.testing.assert_allclose(scene.truth(NADIR, 4 * S).vector, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("sun_deg", "visible"), [((94.9, 0), True), ((0, -95.1), False), ((150, 0), False)]
)
def test_sun_is_seen_within_the_field(sun_deg: tuple[float, float], visible: bool) -> None:
    scene = EarthSunScene.facing(sun_deg, altitude_km=1e6)
    assert scene.truth(SUN, 0, field_deg=95).visible is visible
    assert scene.truth(SUN, 0).visible


def test_sun_behind_the_earth_is_not_seen() -> None:
    # The sun camera looks down here. The limb is 63.48 deg from the nadir.
    down = Mounting([0, 0, 1])
    for theta, visible in ((63.3, False), (63.7, True)):
        scene = EarthSunScene.facing((theta, 0), sun_camera=down)
        assert scene.truth(SUN, 0, field_deg=95).visible is visible
    assert scene.truth(SUN, 0).visible


def test_earth_is_visible_while_any_part_is_in_the_field() -> None:
    for theta, visible in ((158.0, True), (159.0, False)):
        assert EarthSunScene.facing(nadir_deg=(theta, 0)).truth(NADIR, 0, 95).visible is visible


def test_rejects_unknown_hazards() -> None:
    with pytest.raises(SceneError, match="hazards must be hazards of light, not 5"):
        EarthSunScene(hazards=(5,))  # type: ignore[arg-type]


def ball_angles(**place: object) -> tuple[float, float]:
    truth = ball_scene(**place).truth(CameraTarget.NADIR, 0)  # type: ignore[arg-type]
    return truth.alpha_deg, truth.beta_deg


def test_ball_scene_has_the_earths_size_and_the_stage_direction() -> None:
    assert angular_radius_deg(ball_scene().altitude_km) == pytest.approx(63.5, abs=0.05)
    assert ball_angles(angle_deg=(12, -25)) == pytest.approx((12, -25))
    near = ball_scene(radius_mm=100, distance_mm=100)
    assert angular_radius_deg(near.altitude_km) == pytest.approx(30)


def test_ball_direction_accounts_for_the_offset_of_the_camera() -> None:
    # In the plane: the ball's centre is 335.2 mm from the axis, the camera 10 mm before it.
    along, across = 335.2 * np.cos(np.radians(30)) - 10, 335.2 * np.sin(np.radians(30))
    seen_deg = np.degrees(np.arctan2(across, along))
    assert ball_angles(angle_deg=(30, 0), offset_mm=(0, 0, 10)) == pytest.approx((seen_deg, 0))
    moved = ball_scene((30, 0), offset_mm=(0, 0, 10))
    sine = np.sin(np.radians(angular_radius_deg(moved.altitude_km)))
    assert sine == pytest.approx(300 / np.hypot(along, across))
    assert ball_angles(angle_deg=(0, 0), offset_mm=(5, 0, 0))[0] < 0
    near_deg, _ = ball_angles(angle_deg=(30, 0), offset_mm=(0, 0, 1))
    assert near_deg - 30 == pytest.approx(0.085, abs=1e-3)


def test_ball_scene_is_lit_evenly_without_glow() -> None:
    scene = ball_scene((10, 0))
    assert scene.glow_km == scene.unevenness == 0
    np.testing.assert_allclose(scene.sun, -np.asarray(scene.nadir))
    assert ball_scene(unevenness=0.1, seed=3).earth.unevenness == 0.1


def test_ball_scene_rejects_impossible_positions() -> None:
    with pytest.raises(SceneError, match="distance_mm must be above 0 mm, not 0"):
        ball_scene(distance_mm=0)
    with pytest.raises(SceneError, match="offset_mm must leave the camera outside the ball"):
        ball_scene(offset_mm=(0, 0, 36))
