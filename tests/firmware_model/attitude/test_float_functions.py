"""Functions of single precision: accuracy beside double precision, and their special points."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_cosine, arc_tangent, cosine, sine

RNG = np.random.default_rng(5)
F = np.float32


def units(found: NDArray[np.float32], wanted: NDArray[np.float64]) -> float:
    """Largest error in units of the last place."""
    assert found.dtype == np.float32
    return float(np.max(np.abs(found - wanted) / np.spacing(np.abs(wanted).astype(F))))


def test_the_arc_cosine_is_good_to_the_last_places() -> None:
    x = np.concatenate([RNG.uniform(-1, 1, 100_000), 1 - np.logspace(-7, -1, 1000)]).astype(F)
    assert units(arc_cosine(x), np.arccos(x.astype(float))) < 2


def test_the_arc_tangent_is_good_to_the_last_places() -> None:
    y, x = RNG.normal(size=(2, 100_000)).astype(F)
    assert units(arc_tangent(y, x), np.arctan2(y.astype(float), x.astype(float))) < 3


@pytest.mark.parametrize(("function", "exact"), [(sine, np.sin), (cosine, np.cos)])
def test_waves_are_good_to_the_last_places_of_1(
    function: Callable[[Any], NDArray[np.float32]], exact: Callable[[Any], Any]
) -> None:
    x = RNG.uniform(-np.pi, 2 * np.pi, 100_000).astype(F)
    assert np.max(np.abs(function(x) - exact(x.astype(float)))) < 2**-23


def test_special_points() -> None:
    assert arc_cosine(np.array([1, 0.5, 0, -0.5, -1], F)).tolist() == pytest.approx(
        [0, math.pi / 3, math.pi / 2, 2 * math.pi / 3, math.pi], rel=1e-7
    )
    y, x = np.array([(0, 0), (1, 0), (0, -1), (-1, 0), (0, 1), (1, 1)], F).T
    corners = arc_tangent(y, x)
    assert corners.tolist() == pytest.approx(
        [0, math.pi / 2, math.pi, -math.pi / 2, 0, math.pi / 4], rel=1e-7
    )
    assert sine(np.zeros(1, F)) == 0
    assert cosine(np.zeros(1, F)) == 1
