"""A rolling shutter, row by row, in exact fractions."""

from fractions import Fraction

import pytest

from cubestack.emulator.camera.common.shutter import RollingShutter

LINE_PS = Fraction(10**12, 3)  # a third of a second, so that nothing is even by chance


@pytest.mark.parametrize("exposure", [1, 2, 7])
def test_each_row_is_exposed_up_to_its_own_readout(exposure: int) -> None:
    shutter = RollingShutter(5 * 10**12, LINE_PS, exposure, 4)
    assert shutter.line_s == pytest.approx(1 / 3)
    assert shutter.exposure_s == pytest.approx(exposure / 3)
    assert shutter.relative_exposure == pytest.approx(exposure / 4)
    for row in (0, 1, 2.5, 511):
        end = shutter.readout_ps + row * LINE_PS
        begin = end - exposure * LINE_PS
        assert shutter.mid_exposure_ps(row) == pytest.approx(float(begin + end) / 2, abs=0.51)
