import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.luminance import luminance, stuck_pixels
from cubestack.emulator.scene.earth_sun import CameraTarget

NONE = np.zeros(0, np.int64)


def flat(level: float) -> np.ndarray:
    return np.full((480, 640), level, np.float32)


def test_ideal_levels() -> None:
    steps = flat(0)
    steps[0, :6] = [0.4, 0.6, 119, 220.4, 221, 1e6]
    grey = luminance(steps, 1.0, None, NONE)
    assert grey.dtype == np.uint8
    np.testing.assert_array_equal(grey[0, :7], [34, 35, 153, 254, 255, 255, 34])
    # Gain raises the light, and not the black level.
    assert np.all(luminance(flat(10), 3.5, None, NONE) == 34 + 35)
    assert np.all(luminance(flat(0), 7.75, None, NONE) == 34)


@pytest.mark.parametrize(
    ("light", "gain", "sigma"), [(0, 1, 0.7), (119, 1, 0.88), (200, 1, 0.98), (0, 4, 2.8)]
)
def test_noise_has_48_db_at_full_scale(light: float, gain: float, sigma: float) -> None:
    grey = luminance(flat(light), gain, np.random.default_rng(1), NONE).astype(float)
    assert grey.mean() == pytest.approx(34 + light, abs=0.02)
    # Rounding to whole grey values adds a variance of 1/12.
    assert grey.std() == pytest.approx(np.hypot(sigma, 12**-0.5), rel=0.02)


def test_noise_is_that_of_its_generator() -> None:
    one, same, other = (
        luminance(flat(50), 1.0, np.random.default_rng(seed), NONE) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert np.any(one != other)


def test_stuck_pixels_are_at_full_scale() -> None:
    stuck = stuck_pixels(3, CameraTarget.SUN, 20, 10)
    grey = luminance(flat(0), 1.0, None, stuck)
    assert np.count_nonzero(grey == 255) == 40
    assert np.all(grey.ravel()[stuck] == 255)


def test_pairs_are_side_by_side_and_never_three() -> None:
    for seed in range(20):
        hot = np.zeros(480 * 640, bool)
        hot[stuck_pixels(seed, CameraTarget.NADIR, 300, 200)] = True
        rows = hot.reshape(480, 640).astype(int)
        pairs = rows[:, 1:] + rows[:, :-1] == 2
        triples = rows[:, 2:] + rows[:, 1:-1] + rows[:, :-2] == 3
        assert (rows.sum(), pairs.sum(), triples.sum()) == (700, 200, 0)


def test_each_camera_has_its_own_stuck_pixels() -> None:
    sun, again = stuck_pixels(1, CameraTarget.SUN, 10, 0), stuck_pixels(1, CameraTarget.SUN, 10, 0)
    np.testing.assert_array_equal(sun, again)
    assert np.any(sun != stuck_pixels(1, CameraTarget.NADIR, 10, 0))
    assert np.any(sun != stuck_pixels(2, CameraTarget.SUN, 10, 0))
