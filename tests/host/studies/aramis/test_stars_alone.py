"""Rates of AraMiS' identification alone."""

import pytest

from cubestack.host.studies.aramis.sky import Light
from cubestack.host.studies.aramis.stars_alone import CASES, PRINTED, outcomes, stars_alone

POSES = 20


@pytest.mark.slow
def test_every_pose_ends_in_one_way_and_wrong_ones_a_field_off_are_wrong() -> None:
    found = stars_alone(None, POSES)
    for name in CASES:
        ends = [found[f"{name}, {one}"] for one in ("right", "wrong", "ambiguous", "none")]
        assert sum(ends) == pytest.approx(100)
        assert found[f"{name}, far"] <= found[f"{name}, wrong"]
    assert found["1 px, right"] < found["0.1 px, right"]
    assert found["appendix E, wrong"] > found["0.26 px, wrong"]


def test_without_stars_nothing_is_found() -> None:
    assert outcomes(5, PRINTED, Light(mag_limit=-2.0)) == {"none": 5}
