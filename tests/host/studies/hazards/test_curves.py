import pytest
from scipy.stats import binomtest

from cubestack.host.devices.registry import device
from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.hazards.curves import Job, devices_with_hazards, hazards_of, run


@pytest.mark.parametrize(("count", "of"), [(0, 20), (1, 20), (13, 40), (20, 20), (3, 1000)])
def test_wilson_limits_match_scipy(count: int, of: int) -> None:
    other = binomtest(count, of).proportion_ci(0.95, "wilson")
    assert wilson(count, of) == pytest.approx((other.low, other.high), abs=1e-5)
    assert wilson(0, 0) == (0.0, 1.0)


def test_star_trackers_have_hazards_of_the_sky() -> None:
    assert {"cubestar", "aramis"} <= set(devices_with_hazards())
    assert {"moon", "protons", "gradient"} <= set(hazards_of(device("cubestar")))


def test_only_cubesense_has_hazards_of_the_earth() -> None:
    of_earth = {"clouds", "terminator", "earth-in-sun-camera"}
    assert of_earth <= set(hazards_of(device("cubesense")))
    assert not of_earth & {*hazards_of(device("cubestar")), *hazards_of(device("aramis"))}


def test_each_camera_has_a_picture_per_frame() -> None:
    (point,) = run([Job("cubesense", "extended", "terminator", 0.0, 2, 4)], 1)
    assert (point.pictures, point.right) == (4, 4)


def test_points_do_not_depend_on_the_number_of_workers() -> None:
    jobs = [Job("cubestar", "extended", "gradient", strength, 2, 4) for strength in (0.0, 60.0)]
    alone = list(run(jobs, 1))
    assert alone == list(run(jobs, 2))
    assert [point.strength for point in alone] == [0.0, 60.0]
    assert all(point.right + point.refused + point.wrong == 2 for point in alone)
    assert alone[0].right == 2


def test_dark_sky_is_refused_with_a_reason() -> None:
    (point,) = run([Job("cubestar", "extended", "defocus", 6.0, 2, 4)], 1)
    assert point.wrong == 0
    assert sum(point.reasons.values()) == point.refused
