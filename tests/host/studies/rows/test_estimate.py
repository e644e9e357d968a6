import math
import pickle

import numpy as np
import pytest

from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.rows.estimate import Estimate, average, deviation, rate, resampled


def test_estimate_is_formatted_with_its_limits() -> None:
    assert f"{Estimate(94.04, 90.66, 96.21):.1f} %" == "94.0 (90.7 to 96.2) %"
    assert f"{Estimate(math.nan, 0, 1):.1f}" == "nan"
    assert Estimate(2.0, 1, 3) + 1 == 3


def test_estimate_keeps_its_limits_between_processes() -> None:
    back = pickle.loads(pickle.dumps(Estimate(2.0, 1, 3)))
    assert (back, back.low, back.high) == (2, 1, 3)


def test_rate_has_wilson_limits() -> None:
    found = rate([True] * 9 + [False])
    assert (found, found.low / 100, found.high / 100) == (90, *wilson(9, 10))
    assert rate([False] * 10).high > 20
    assert math.isnan(rate([]))


@pytest.mark.parametrize("summary", ["average", "bootstrap"])
def test_limits_of_a_mean_contain_it_in_95_percent_of_samples(summary: str) -> None:
    rng, inside, samples = np.random.default_rng(3), 0, 200
    for _ in range(samples):
        values = rng.normal(5, 2, 40)
        if summary == "average":
            found = average(values)
        else:
            each = [[one] for one in values]
            made = resampled(lambda some: {"mean": float(np.mean(some))}, each)["mean"]
            assert isinstance(made, Estimate)
            found = made
        inside += found.low < 5 < found.high
    assert 0.88 < inside / samples < 0.99


def test_limits_of_a_mean_are_within_the_values() -> None:
    found = average([100.0] * 40 + [60.0])
    assert 60 < found.low < found < found.high == 100


def test_limits_of_a_deviation_contain_it() -> None:
    rng, inside, samples = np.random.default_rng(4), 0, 400
    for _ in range(samples):
        found = deviation(float(rng.normal(0, 2, 50).std(ddof=1)), 49)
        inside += found.low < 2 < found.high
    assert 0.9 < inside / samples < 0.99


def test_groups_are_drawn_as_a_whole() -> None:
    """Values of a unit are the same, so a hundred of ten units say no more than ten."""
    groups = [[float(unit)] * 10 for unit in range(10)]
    found = resampled(lambda some: {"mean": sum(some) / len(some)}, groups)["mean"]
    assert isinstance(found, Estimate)
    assert found.high - found.low == pytest.approx(2 * 1.96 * 2.87 / math.sqrt(10), rel=0.2)


def test_extremes_and_known_limits_are_left_as_they_are() -> None:
    known = Estimate(1, 0, 2)
    found = resampled(
        lambda some: {"worst": max(some), "rate": known, "lost": math.nan},
        [[1.0], [2.0]],
        ("worst",),
    )
    assert type(found["worst"]) is float
    assert found["rate"] is known
    assert math.isnan(found["lost"])
