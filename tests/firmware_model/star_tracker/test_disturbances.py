"""Which disturbance explains that no stars were identified."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.aramis.pipeline import LIMITS as ARAMIS
from cubestack.firmware_model.cubestar.processing.estimate import LIMITS as CUBESTAR
from cubestack.firmware_model.star_tracker.quality import (
    Disturbance,
    DisturbanceLimits,
    SkyStatistics,
)

SKIES = st.builds(
    SkyStatistics,
    background=st.floats(0, 255),
    background_range=st.floats(0, 255),
    noise=st.floats(0, 100),
    saturated=st.floats(0, 1),
    spikes=st.integers(0, 500_000),
)
both = pytest.mark.parametrize("limits", [ARAMIS, CUBESTAR])


@both
@given(sky=SKIES, stars=st.integers(0, 60), large=st.booleans())
def test_light_explains_nothing_where_many_stars_are_seen(
    limits: DisturbanceLimits, sky: SkyStatistics, stars: int, *, large: bool
) -> None:
    found = limits.exceeded(sky, stars, large=large)
    if stars >= limits.enough and sky.saturated <= limits.blind:
        assert found is (Disturbance.RADIATION if sky.spikes > limits.spikes else None)


@both
@given(sky=SKIES, stars=st.integers(0, 60), large=st.booleans())
def test_fewer_stars_never_hide_a_disturbance(
    limits: DisturbanceLimits, sky: SkyStatistics, stars: int, *, large: bool
) -> None:
    if limits.exceeded(sky, stars, large=large) is not None:
        assert limits.exceeded(sky, stars // 2, large=large) is not None


@both
def test_streaks_come_before_hits(limits: DisturbanceLimits) -> None:
    sky = SkyStatistics(0, 0, 1, 0, 500_000)
    assert limits.exceeded(sky, 60, smear=True, tracks=True) is Disturbance.SMEAR
    assert limits.exceeded(sky, 60, tracks=True) is Disturbance.RADIATION
