from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_light, star_pixels
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.lens import (
    LIKELY_FIELD_DEG,
    PUBLISHED_FIELD_DEG,
    double_gauss,
)
from cubestack.emulator.scene.sky import SkyScene

ORION = SkyScene.pointing(84.0, -1.0)
LENS = double_gauss()
SHUTTER = RollingShutter(10**12, Fraction(31_750_000), 3000, 3000)


@pytest.mark.parametrize("field_deg", [LIKELY_FIELD_DEG, PUBLISHED_FIELD_DEG])
def test_image_height_spans_the_field_of_view(field_deg: float) -> None:
    lens = double_gauss(field_deg)
    middle = (lens.columns - 1) / 2
    top, bottom = lens.unproject(np.array([[middle, -0.5], [middle, 1023.5]]))
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(field_deg)


def test_lens_shade_limits_the_field() -> None:
    angles = np.radians([0.0, 8.99, 9.01, 12.0])
    vectors = np.stack([np.sin(angles), np.zeros(4), np.cos(angles)], axis=1)
    for shade, light in ((True, [1, 1, 0, 0]), (False, [1, 1, 1, 1])):
        assert double_gauss(18.0, shade=shade).transmission(vectors).tolist() == light


@pytest.mark.parametrize("field_deg", [4.9, 41.0, float("nan")])
def test_rejects_field_of_view_out_of_range(field_deg: float) -> None:
    with pytest.raises(ValueError, match="5 to 40 deg"):
        double_gauss(field_deg)


def test_star_light_has_the_sensor_size_and_peaks_at_the_stars() -> None:
    light = star_light(ORION, LENS, SHUTTER)
    assert light.shape == (1024, 1280)
    hip, pixels = star_pixels(ORION, LENS, SHUTTER)
    x, y = np.rint(pixels[list(hip).index(24436)]).astype(int)  # Rigel
    assert light[y - 1 : y + 2, x - 1 : x + 2].max() == light.max()


def test_lens_shade_removes_stars_beyond_the_field() -> None:
    y, x = np.mgrid[:1024, :1280]
    outside = np.hypot(x - 639.5, y - 511.5) > 530
    assert star_light(ORION, double_gauss(shade=False), SHUTTER)[outside].sum() > 0
    assert star_light(ORION, LENS, SHUTTER)[outside].sum() == 0
