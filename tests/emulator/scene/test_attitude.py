import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene import attitude


@pytest.fixture
def quaternions() -> list[np.ndarray]:
    generator = np.random.default_rng(1)
    special = [np.eye(4)[i] for i in range(4)]  # half turns and identity
    near = [np.array([1, 1e-9, 0, 1e-9]), np.array([1e-12, 0, 1, -1e-12])]
    return special + near + [attitude.random_quaternion(generator) for _ in range(200)]


def test_quaternion_matrix_conversions_match_scipy(quaternions: list[np.ndarray]) -> None:
    for q in quaternions:
        matrix = attitude.matrix_from_quaternion(q)
        np.testing.assert_allclose(matrix, Rotation.from_quat(q).as_matrix(), atol=1e-14)
        back, unit = attitude.quaternion_from_matrix(matrix), q / np.linalg.norm(q)
        assert back[3] >= 0
        assert min(np.abs(back - unit).max(), np.abs(back + unit).max()) < 1e-14


def test_pointing_matrix_has_north_up_and_east_left() -> None:
    # Looking at the celestial equator at 6 h with north up: east is left, so west is camera x.
    a = attitude.matrix_from_pointing(90.0, 0.0, 0.0)
    np.testing.assert_allclose(a @ [0, 1, 0], [0, 0, 1], atol=1e-15)  # boresight
    np.testing.assert_allclose(a @ [0, 0, 1], [0, -1, 0], atol=1e-15)  # north is up, -y
    np.testing.assert_allclose(a @ [-1, 0, 0], [-1, 0, 0], atol=1e-15)  # east is left, -x
    assert np.linalg.det(a) == pytest.approx(1)
    rolled = attitude.matrix_from_pointing(90.0, 0.0, 90.0)
    np.testing.assert_allclose(rolled @ [-1, 0, 0], [0, -1, 0], atol=1e-15)  # east is up


def test_pointing_round_trips_through_matrix_and_quaternion() -> None:
    generator = np.random.default_rng(2)
    for ra, dec, roll in generator.uniform([0, -89.9, -180], [360, 89.9, 180], (200, 3)):
        a = attitude.matrix_from_pointing(ra, dec, roll)
        np.testing.assert_allclose(a @ a.T, np.eye(3), atol=1e-14)
        assert attitude.pointing_from_matrix(a) == pytest.approx((ra, dec, roll), abs=1e-9)
        quaternion = attitude.quaternion_from_pointing(ra, dec, roll)
        np.testing.assert_allclose(attitude.matrix_from_quaternion(quaternion), a, atol=1e-14)
    for pole in (90.0, -90.0):
        a = attitude.matrix_from_pointing(30.0, pole, 20.0)
        same = attitude.matrix_from_pointing(*attitude.pointing_from_matrix(a))
        np.testing.assert_allclose(same, a, atol=1e-14)


def test_stars_move_opposite_to_the_camera() -> None:
    # Turning about +x lifts the view (z towards -y, up), so a star sinks: its y grows.
    q = attitude.propagate([0, 0, 0, 1], [1.0, 0, 0], 2.0)
    star = attitude.matrix_from_quaternion(q) @ [0, 0, 1]
    np.testing.assert_allclose(star, [0, np.sin(np.radians(2)), np.cos(np.radians(2))], atol=1e-15)


def test_propagation_equals_many_small_steps() -> None:
    generator = np.random.default_rng(3)
    for _ in range(20):
        q, rate = attitude.random_quaternion(generator), generator.normal(0, 5, 3)
        a = Rotation.from_quat(q)
        step = Rotation.from_rotvec(-np.radians(rate) * 0.01)
        for _ in range(100):
            a = step * a
        moved = attitude.matrix_from_quaternion(attitude.propagate(q, rate, 1.0))
        np.testing.assert_allclose(moved, a.as_matrix(), atol=1e-12)
    q = attitude.unit_quaternion([1, 2, 3, 4])
    np.testing.assert_allclose(attitude.propagate(q, [0, 0, 0], 1e6), q, atol=1e-15)


def test_attitude_error_separates_cross_axis_and_roll() -> None:
    generator = np.random.default_rng(4)
    for _ in range(50):
        truth = attitude.random_quaternion(generator)
        roll = float(generator.uniform(-170, 170))
        rolled = attitude.propagate(truth, [0, 0, roll], 1)
        assert attitude.attitude_error_deg(rolled, truth) == pytest.approx((0, roll), abs=1e-10)
        direction = generator.uniform(0, 2 * np.pi)
        rate = 1e-5 * np.array([np.cos(direction), np.sin(direction), 0])
        cross, about = attitude.attitude_error_deg(attitude.propagate(truth, rate, 1), truth)
        assert cross == pytest.approx(1e-5, rel=1e-6)
        assert about == pytest.approx(0, abs=1e-9)
    # Sign and length of quaternions do not matter.
    assert attitude.attitude_error_deg([0, 0, 0, -3], [0, 0, 0, 1]) == (0, 0)


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [1, 2, 3], [np.nan, 0, 0, 1], [np.inf, 0, 0, 1]])
def test_rejects_invalid_attitudes(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="a quaternion"):
        attitude.unit_quaternion(bad)
