import numpy as np

from cubestack.firmware_model.cubesense.vision.masks import Mask, masked
from cubestack.firmware_model.mcu.costs import Meter


def test_an_area_includes_its_ends(meter: Meter) -> None:
    x, y = np.meshgrid(np.arange(20), np.arange(20))
    inside = masked(x.ravel(), y.ravel(), [Mask(3, 5, 7, 8)], meter).reshape(20, 20)
    expected = np.zeros((20, 20), bool)
    expected[7:9, 3:6] = True
    assert (inside == expected).all()


def test_an_area_of_zeros_is_none(meter: Meter) -> None:
    origin = np.zeros(1, np.int64)
    assert not masked(origin, origin, [Mask()] * 5, meter).any()
    assert meter.counts["i16_add"] == 0


def test_areas_add_up(meter: Meter) -> None:
    at = np.arange(10)
    inside = masked(at, at, [Mask(1, 2, 0, 9), Mask(), Mask(8, 9, 0, 9)], meter)
    assert np.flatnonzero(inside).tolist() == [1, 2, 8, 9]
