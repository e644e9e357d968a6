from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import (
    attitude_error_deg,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.sky import MOST_FALSE_STARS, Pose, SceneError, SkyScene


def test_truth_follows_the_rate() -> None:
    q = quaternion_from_pointing(10, 20, 30)
    scene = SkyScene(q, (0, 0.5, 0))
    assert attitude_error_deg(scene.truth(0), q) == pytest.approx((0, 0), abs=1e-12)
    assert attitude_error_deg(scene.truth(4 * 10**12), q) == pytest.approx((2.0, 0), abs=1e-9)


def test_later_poses_hold_from_their_start_on() -> None:
    first, second, third = (quaternion_from_pointing(ra, 0, 0) for ra in (0, 50, 100))
    poses = (Pose(second, at_s=1.0), Pose(third, (1.0, 0, 0), at_s=2.5))
    scene = SkyScene(first, poses=poses)
    for time_s, expected in ((1 - 1e-12, first), (1, second), (2, second)):
        np.testing.assert_allclose(scene.truth(round(time_s * 10**12)), expected)
    np.testing.assert_allclose(scene.truth(35 * 10**11), propagate(third, (1.0, 0, 0), 1.0))
    assert scene.speed_deg_s == 1.0


def test_turned() -> None:
    q = quaternion_from_pointing(10, 20, 30)
    scene = SkyScene(q, mag_limit=3.0, poses=(Pose(q, at_s=1.0),)).rotate((0, 0, 5.0))
    for time_ps in (0, 2 * 10**12):
        assert attitude_error_deg(scene.truth(time_ps), q) == pytest.approx((0, 5.0), abs=1e-9)
    assert scene.mag_limit == 3.0


def test_false_lights_are_those_of_the_seed() -> None:
    sky = SkyScene([0, 0, 0, 1], false_stars=200, false_star_mag=(1.0, 2.0), seed=3)
    places, magnitudes = sky.false_lights()
    assert (places.shape, magnitudes.shape) == ((200, 2), (200,))
    assert 0 <= places.min() < 0.1 < 0.9 < places.max() < 1
    assert 1 < magnitudes.min() < 1.1 < 1.9 < magnitudes.max() < 2
    np.testing.assert_array_equal(sky.false_lights()[0], places)
    assert np.any(replace(sky, seed=4).false_lights()[0] != places)
    most = replace(sky, false_stars=MOST_FALSE_STARS).false_lights()[0]
    assert len(most) == MOST_FALSE_STARS
    assert np.all((most >= 0) & (most < 1))


def test_rejects_a_quaternion_of_another_length() -> None:
    with pytest.raises(SceneError, match="a quaternion has 4 numbers"):
        SkyScene([0, 0, 1])


@pytest.mark.parametrize(
    ("starts", "right"),
    [((), True), ((0.0,), True), ((1.0, 1.0, 2.0), True), ((2.0, 1.0), False), ((-0.1,), False)],
)
def test_poses_come_one_after_the_other(starts: tuple[float, ...], right: bool) -> None:
    q = quaternion_from_pointing(10, 20, 30)
    poses = tuple(Pose(q, at_s=start_s) for start_s in starts)
    if right:
        assert SkyScene(q, poses=poses).poses == poses
        return
    with pytest.raises(SceneError, match="poses must be in order of time from 0 s on"):
        SkyScene(q, poses=poses)
