import pytest

from cubestack.host.ground.scenes import magnitude


def test_magnitudes_match_the_catalogue() -> None:
    for hipparcos, v_mag in ((32349, -1.44), (11767, 1.97), (78727, 4.16)):
        assert magnitude(hipparcos) == pytest.approx(v_mag, abs=0.05)
    assert magnitude(0) is magnitude(999_999) is None
