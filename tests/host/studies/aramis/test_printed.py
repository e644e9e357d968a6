"""Trials of what the thesis prints twice, on a few images."""

import pytest

from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.aramis.printed import VARIANCES, bounds, spikes
from cubestack.host.studies.rows.trial import Figures


@pytest.fixture(scope="module")
def found() -> Figures:
    return bounds(Opener(device("aramis")), 30)


def test_triangles_within_bounds_grow_with_the_variance(found: Figures) -> None:
    names = sorted(VARIANCES, key=VARIANCES.__getitem__)
    assert names == ["fixed", "noted", "older", "run"]
    counts = [found[name] for name in names]
    assert counts == sorted(counts)
    assert found["run"] > 2 * found["noted"]


def test_right_triangle_is_within_bounds_that_expect_the_noise(found: Figures) -> None:
    assert found["sensor_run"] == found["sensor_noted"] == 100
    assert found["run_run"] > found["run_noted"] > found["run_fixed"]


def test_variance_of_the_last_line_is_a_ten_thousandth_of_a_pixel() -> None:
    assert VARIANCES["fixed"] == pytest.approx(1.13e-4, rel=0.01)


def test_both_methods_remove_spikes_and_the_second_loses_stars_in_less_time() -> None:
    figures = spikes(Opener(device("aramis")), 3)
    assert figures["off_false"] > 20
    assert figures["centre_false"] < 1 > figures["window_false"]
    assert figures["window_bright"] < figures["centre_bright"] <= figures["off_bright"]
    assert figures["window_ms"] < figures["centre_ms"] < figures["printed_ms"]
