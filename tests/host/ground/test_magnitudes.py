"""Magnitudes of stars by their numbers."""

import pytest

from cubestack.host.ground.magnitudes import magnitude


@pytest.mark.parametrize(("hipparcos", "v_mag"), [(32349, -1.44), (11767, 1.97), (78727, 4.16)])
def test_a_star_is_as_bright_as_it_is_listed(hipparcos: int, v_mag: float) -> None:
    assert magnitude(hipparcos) == pytest.approx(v_mag, abs=0.05)


@pytest.mark.parametrize("hipparcos", [0, 999_999])
def test_what_is_not_listed_has_none(hipparcos: int) -> None:
    assert magnitude(hipparcos) is None
