from fractions import Fraction

import pytest

from cubestack.emulator.camera.common.shutter import RollingShutter

LINE = Fraction(132_200_000)


def test_middle_of_the_middle_row() -> None:
    shutter = RollingShutter(10**12, LINE, 2917, 2917)
    # Row 255.5 is read out 255.5 lines after row 0, and its exposure began 2917 lines earlier.
    read_out = 1.0 + 255.5 * 132.2e-6
    assert shutter.mid_exposure_ps(255.5) / 1e12 == pytest.approx(read_out - 2917 * 132.2e-6 / 2)
    assert shutter.exposure_s == pytest.approx(0.3856274)


def test_rows_follow_by_a_line_time() -> None:
    shutter = RollingShutter(5, LINE, 100, 100)
    assert shutter.mid_exposure_ps(0) == 5 - 50 * 132_200_000
    assert shutter.mid_exposure_ps(511) - shutter.mid_exposure_ps(0) == 511 * 132_200_000


def test_relative_exposure() -> None:
    assert RollingShutter(0, LINE, 100, 400).relative_exposure == 0.25
