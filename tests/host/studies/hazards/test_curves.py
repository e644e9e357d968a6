"""Curves of hazards: limits of rates, jobs, and points that do not depend on the workers."""

import pytest
from scipy.stats import binomtest

from cubestack.host.devices.registry import device
from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.hazards.curves import (
    Job,
    devices_with_hazards,
    hazards_of,
    jobs_of,
    run,
)


@pytest.mark.parametrize(("count", "of"), [(0, 20), (1, 20), (13, 40), (20, 20), (3, 1000)])
def test_limits_are_those_of_wilson(count: int, of: int) -> None:
    other = binomtest(count, of).proportion_ci(0.95, "wilson")
    assert wilson(count, of) == pytest.approx((other.low, other.high), abs=1e-5)


def test_nothing_seen_limits_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


def test_star_trackers_take_all_hazards_of_the_sky() -> None:
    assert {"cubestar", "aramis"} <= set(devices_with_hazards())
    assert {"moon", "protons", "gradient"} <= set(hazards_of(device("cubestar")))


def test_only_a_device_with_an_earth_below_takes_what_is_of_the_earth() -> None:
    of_earth = {"clouds", "terminator", "earth-in-sun-camera"}
    assert of_earth <= set(hazards_of(device("cubesense")))
    assert not of_earth & {*hazards_of(device("cubestar")), *hazards_of(device("aramis"))}


def test_each_camera_has_a_picture_of_each_frame() -> None:
    (point,) = run([Job("cubesense", "extended", "terminator", 0.0, 2, 4)], 1)
    assert (point.pictures, point.right) == (4, 4)


def test_a_hazard_that_a_device_has_not_is_named() -> None:
    with pytest.raises(ValueError, match="hazard: cubestar has no 'rain'; known: aberration"):
        list(jobs_of("cubestar", ["rain"], 1, 0, "extended"))


def test_points_are_the_same_with_one_worker_and_two() -> None:
    jobs = [Job("cubestar", "extended", "gradient", strength, 2, 4) for strength in (0.0, 60.0)]
    alone = list(run(jobs, 1))
    assert alone == list(run(jobs, 2))
    assert [point.strength for point in alone] == [0.0, 60.0]
    assert all(point.right + point.refused + point.wrong == 2 for point in alone)
    assert alone[0].right == 2


def test_a_black_sky_is_refused_with_its_reason() -> None:
    (point,) = run([Job("cubestar", "extended", "defocus", 6.0, 2, 4)], 1)
    assert point.wrong == 0
    assert sum(point.reasons.values()) == point.refused
