"""Loops and light in C++ and frames that are one event change no byte, time or charge."""

import pytest

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.firmware_model.mcu.inner_loops import loops_in_use
from tests.system.forms import SENSORS, differs, observed, slow_form
from tests.system.life import life, pair_life
from tests.tiers import quick_ones


@pytest.mark.parametrize("profile", quick_ones(PROFILES, "extended"))
@pytest.mark.parametrize("name", SENSORS)
def test_forms_are_equal(name: str, profile: str) -> None:
    fast, _ = observed(name, profile, 1)
    assert loops_in_use() is not None
    assert len(fast["answers"]) > 20
    heard, traffic = observed(name, profile, 1, tapped=True)
    assert heard == fast
    with slow_form():
        assert observed(name, profile, 1, tapped=True) == (fast, traffic)
        assert loops_in_use() is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_forms_are_equal_with_faults(seed: int) -> None:
    assert not differs(lambda: life(seed))
    assert not differs(lambda: pair_life(seed, "one-search"))
