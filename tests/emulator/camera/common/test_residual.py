"""Displacements of the picture: the polynomial is numpy's, and both ways undo each other."""

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval2d

from cubestack.emulator.camera.common.residual import Residual, displace, restore

SHAPE = (512, 1024)
GENERATOR = np.random.default_rng(11)
ACROSS = tuple(tuple(row) for row in (GENERATOR.uniform(-1, 1, (4, 3)) * 0.5).tolist())
DOWN = ((0.2, 0.0, -0.3, 0.0, 0.0), (0.0,), (), (0.1, 0.4))
"""With rows of other lengths, and zeros at their ends."""

RESIDUAL = Residual(SHAPE, ACROSS, DOWN)
PIXELS = GENERATOR.uniform((0, 0), (1023, 511), (400, 2))


def test_it_is_a_polynomial_over_the_sensor() -> None:
    x, y = PIXELS[:, 0] / 511.5 - 1, PIXELS[:, 1] / 255.5 - 1
    down = np.array([row + (0.0,) * (5 - len(row)) for row in DOWN])
    expected = [polyval2d(x, y, np.array(ACROSS)), polyval2d(x, y, down)]
    np.testing.assert_allclose(RESIDUAL.at(PIXELS).T, expected, atol=1e-12)


def test_corners_are_the_ends_of_the_scale_and_hold_beyond() -> None:
    tilt = Residual(SHAPE, ((0.0,), (1.0,)), ((0.0, 1.0),))
    corners = np.array([[0.0, 0.0], [1023.0, 0.0], [1023.0, 511.0], [511.5, 255.5]])
    expected = [[-1, -1], [1, -1], [1, 1], [0, 0]]
    np.testing.assert_allclose(tilt.at(corners), expected, atol=1e-12)
    beyond = np.array([[-50.0, -1.0], [2000.0, -7.0], [1024.0, 600.0]])
    np.testing.assert_allclose(tilt.at(beyond), expected[:3], atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_both_ways_undo_each_other(count: int) -> None:
    residuals = (RESIDUAL, Residual(SHAPE, DOWN, ACROSS))[:count]
    seen = displace(PIXELS, residuals)
    np.testing.assert_allclose(restore(seen, residuals), PIXELS, atol=1e-10)
    np.testing.assert_allclose(displace(restore(PIXELS, residuals), residuals), PIXELS, atol=1e-9)
    assert bool(np.all(seen == PIXELS)) is (count == 0)


def test_what_is_seen_is_displaced_by_what_holds_there() -> None:
    seen = displace(PIXELS, (RESIDUAL,))
    np.testing.assert_allclose(seen - RESIDUAL.at(seen), PIXELS, atol=1e-10)


def test_nan_points_stay_nan() -> None:
    some = PIXELS.copy()
    some[3] = np.nan
    seen = displace(some, (RESIDUAL,))
    assert np.isnan(seen[3]).all()
    np.testing.assert_array_equal(
        np.delete(seen, 3, 0), np.delete(displace(PIXELS, (RESIDUAL,)), 3, 0)
    )
