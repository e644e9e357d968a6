from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.stream import PixelClock

LINE_PS = 132_200_000


def test_grid_of_a_whole_period() -> None:
    clock = PixelClock(10_000_000, origin_ps=7)
    assert clock.period == 100_000
    assert [clock.edge_ps(k) for k in range(3)] == [7, 100_007, 200_007]
    assert [clock.first_edge(t) for t in (0, 7, 8, 100_007, 100_008)] == [0, 0, 1, 1, 2]
    with pytest.raises(ValueError, match="positive frequency, not 0 Hz"):
        PixelClock(0)


def test_the_slowest_clock() -> None:
    assert PixelClock(1).edge_ps(2) == 2 * 10**12
    with pytest.raises(ValueError, match="positive frequency, not -1 Hz"):
        PixelClock(-1)


def test_grid_does_not_drift() -> None:
    clock = PixelClock(11_000_000)
    assert clock.period == Fraction(10**12, 11_000_000)
    assert clock.edge_ps(11_000_000 * 3600) == 3600 * 10**12


@given(hz=st.integers(1, 60_000_000), origin=st.integers(0, 10**15), time=st.integers(0, 10**16))
def test_first_edge_is_the_first(hz: int, origin: int, time: int) -> None:
    clock = PixelClock(hz, origin)
    edge = clock.first_edge(time)
    assert clock.edge_ps(edge) >= time
    assert edge == 0 or clock.edge_ps(edge - 1) < time


def test_exposure_of_rows() -> None:
    shutter = RollingShutter(10**12, Fraction(LINE_PS), 2917, 4 * 2917)
    # Row 255.5 is read out 255.5 lines after row 0, and its exposure began 2917 lines earlier.
    read_out = 1.0 + 255.5 * 132.2e-6
    assert shutter.mid_exposure_ps(255.5) / 1e12 == pytest.approx(read_out - 2917 * 132.2e-6 / 2)
    assert shutter.mid_exposure_ps(511) - shutter.mid_exposure_ps(0) == 511 * LINE_PS
    assert shutter.exposure_s == pytest.approx(0.3856274)
    assert shutter.relative_exposure == 0.25
