"""Dips of the supply: when the part is in reset, and what it forgets."""

import pytest

from cubestack.emulator.iss.brown_out import (
    BROWN_OUT,
    FALLING_V,
    POWER_ON,
    RETAINED_V,
    RISING_V,
    dip_of,
    volts_at,
)

PS_PER_MS = 10**9


def curve(lowest: float) -> list[tuple[float, float]]:
    return [(0, 3.8), (10, lowest), (20, lowest), (30, 3.8)]


def test_reset_lasts_from_the_falling_to_the_rising_threshold() -> None:
    found = dip_of(curve(1.4))
    assert found is not None
    assert volts_at(curve(1.4), found.reset_ps / PS_PER_MS) == pytest.approx(FALLING_V)
    assert volts_at(curve(1.4), found.release_ps / PS_PER_MS) == pytest.approx(RISING_V)
    assert found.reset_ps < 10 * PS_PER_MS
    assert found.release_ps > 20 * PS_PER_MS


@pytest.mark.parametrize(
    ("lowest", "cause"),
    [(RETAINED_V + 0.01, BROWN_OUT), (RETAINED_V - 0.01, POWER_ON), (0, POWER_ON)],
)
def test_cause_depends_on_the_lowest_voltage(lowest: float, cause: int) -> None:
    found = dip_of(curve(lowest))
    assert found is not None
    assert found.cause == cause
    assert found.forgets == (cause == POWER_ON)


def test_no_reset_above_the_threshold() -> None:
    assert dip_of(curve(FALLING_V + 0.01)) is None


def test_supply_that_stays_low_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"must end above 1\.85 V"):
        dip_of([(0, 3.3), (1, 1.5)])


def test_curve_is_constant_outside_of_its_corners() -> None:
    assert volts_at(curve(1.0), -1) == 3.8
    assert volts_at(curve(1.0), 5) == pytest.approx(2.4)
    assert volts_at(curve(1.0), 99) == 3.8
