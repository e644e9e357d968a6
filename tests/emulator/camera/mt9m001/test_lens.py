import numpy as np
import pytest

from cubestack.emulator.camera.mt9m001.lens import (
    LIKELY_FIELD_DEG,
    PUBLISHED_FIELD_DEG,
    double_gauss,
)


@pytest.mark.parametrize("field_deg", [LIKELY_FIELD_DEG, PUBLISHED_FIELD_DEG])
def test_the_picture_s_height_spans_the_field(field_deg: float) -> None:
    lens = double_gauss(field_deg)
    middle = (lens.columns - 1) / 2
    top, bottom = lens.unproject(np.array([[middle, -0.5], [middle, 1023.5]]))
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(field_deg)


def test_the_shade_ends_the_field() -> None:
    lens = double_gauss(18.0)
    angles = np.radians([0.0, 8.99, 9.01, 12.0])
    vectors = np.stack([np.sin(angles), np.zeros(4), np.cos(angles)], axis=1)
    assert lens.transmission(vectors).tolist() == [1, 1, 0, 0]
    assert double_gauss(18.0, shade=False).transmission(vectors).tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("field_deg", [4.9, 41.0, float("nan")])
def test_a_field_out_of_range_is_refused(field_deg: float) -> None:
    with pytest.raises(ValueError, match="5 to 40 deg"):
        double_gauss(field_deg)
