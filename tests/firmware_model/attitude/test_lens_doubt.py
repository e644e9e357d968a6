"""A lens that is not as described: what the stars show of it, and what is claimed."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.lens_doubt import LARGEST_SIGMA_RAD, LensVerdict, judge_lens
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Reals = NDArray[np.float64]

FOCAL_PX, MIDDLE = 1000.0, np.array([511.5, 255.5])
NOISE_PX = 0.03
METER = Meter(CORTEX_M3)


def rays(pixels: Floats) -> Floats:
    plane = (pixels.astype(np.float32) - MIDDLE.astype(np.float32)) / np.float32(FOCAL_PX)
    vectors = np.column_stack([plane, np.ones(len(plane), np.float32)])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), np.float32)


def turned(seed: int) -> Reals:
    """A random rotation (3, 3)."""
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return np.asarray(matrix * np.linalg.det(matrix))


def judged(
    seed: int,
    stars: int = 14,
    linear: tuple[tuple[float, float], tuple[float, float]] = ((0, 0), (0, 0)),
    shift: tuple[float, float] = (0, 0),
    doubt: float = 0.45,
) -> tuple[LensVerdict, Reals]:
    """The verdict on a picture by an affine lens, and the errors (3,) about the axes in rad."""
    rng = np.random.default_rng(seed)
    true = rng.uniform((0, 0), (1023, 511), (stars, 2))
    attitude = turned(seed)
    reference = (rays(true) @ attitude).astype(np.float32)
    seen = true + (true - MIDDLE) @ np.array(linear).T + np.array(shift)
    seen = (seen + NOISE_PX * rng.standard_normal(seen.shape)).astype(np.float32)
    sigmas = np.full(stars, NOISE_PX / FOCAL_PX, np.float32)
    fit = robust_fit(rays(seen), reference, sigmas, METER, scale=1.0, excess=2.2)
    verdict = judge_lens(seen, reference, sigmas, rays, (511.5, 255.5), fit, METER, doubt)
    away = attitude @ dcm(verdict.quaternion, METER).astype(float).T
    turn = np.array([away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1]])
    return verdict, turn / 2


@pytest.mark.parametrize("seed", range(8))
def test_a_lens_as_described_is_believed(seed: int) -> None:
    verdict, error = judged(seed)
    assert verdict.as_described
    assert not verdict.is_refused
    assert np.all(np.abs(error) < 4 * np.sqrt(np.diag(verdict.covariance)))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("linear", [((0.005, 0), (0, 0)), ((0.02, 0), (0, 0)), ((0, 0.02), (0, 0))])
def test_pixels_of_another_shape_are_recognised_and_corrected(
    seed: int, linear: tuple[tuple[float, float], tuple[float, float]]
) -> None:
    verdict, error = judged(seed, linear=linear)
    assert not verdict.as_described
    assert np.all(np.abs(error[:2]) < 4 * np.sqrt(np.diag(verdict.covariance)[:2]))
    assert verdict.is_refused or np.hypot(*error[:2]) < np.radians(0.1)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("px", [5.0, 20.0, 40.0])
def test_a_principal_point_elsewhere_is_recognised(seed: int, px: float) -> None:
    verdict, error = judged(seed, shift=(px * 0.8, -px * 0.6))
    assert not verdict.as_described
    assert np.all(np.abs(error[:2]) < 4 * np.sqrt(np.diag(verdict.covariance)[:2]))
    assert verdict.error_px[3:5] == pytest.approx((px * 0.8, -px * 0.6), abs=3)


@pytest.mark.parametrize("seed", range(8))
def test_three_stars_that_tell_nothing_of_the_principal_point_leave_it_uncertain(seed: int) -> None:
    few, many = judged(seed, stars=3)[0], judged(seed, stars=30)[0]
    assert few.covariance[0, 0] > 9 * many.covariance[0, 0]


def test_without_doubt_the_fit_is_unchanged() -> None:
    verdict, error = judged(1, shift=(20, 0), doubt=0)
    assert verdict.as_described
    assert np.hypot(*error[:2]) > 10 * np.sqrt(verdict.covariance[0, 0])


@pytest.mark.parametrize("seed", range(8))
def test_an_uncertain_boresight_of_another_lens_is_refused(seed: int) -> None:
    verdict, _ = judged(seed, stars=4, shift=(40, 0))
    across = np.sqrt(np.diag(verdict.covariance)[:2].max())
    assert verdict.is_refused == (not verdict.as_described and across > LARGEST_SIGMA_RAD)
    assert across > 1e-4
