"""A lens that is not as described: what the stars show of it, and what is claimed."""

from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.lens_doubt import (
    LARGEST_SIGMA_RAD,
    STILL,
    LensVerdict,
    judge_lens,
)
from cubestack.firmware_model.attitude.lens_models import LensErrors
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from tests.together import together

Floats = NDArray[np.float32]
Reals = NDArray[np.float64]

FOCAL_PX, MIDDLE = 1000.0, np.array([511.5, 255.5])
NARROW = 8.0  #: factor of the focal length
NOISE_PX = 0.03
METER = Meter(CORTEX_M3)
TOLERANCE = LensErrors(focal=0.7, shape=0.3, point=5.0, radial=3.0, tangential=0.5)


def rays(pixels: Floats, longer: float = 1.0) -> Floats:
    focal = np.float32(FOCAL_PX * longer)
    plane = (pixels.astype(np.float32) - MIDDLE.astype(np.float32)) / focal
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
    cubic: float = 0.0,
    tolerance: LensErrors | None = TOLERANCE,
    longer: float = 1.0,
) -> tuple[LensVerdict, Reals]:
    """The verdict on a picture by an altered lens, and the errors (3,) about the axes in rad."""
    rng = np.random.default_rng(seed)
    true = rng.uniform((0, 0), (1023, 511), (stars, 2))
    attitude, focal_px = turned(seed), FOCAL_PX * longer
    reference = (rays(true.astype(np.float32), longer) @ attitude).astype(np.float32)
    away = true - MIDDLE
    seen = true + away @ np.array(linear).T + np.array(shift)
    seen += cubic * away * np.sum(away**2, axis=1, keepdims=True) / 512**3
    seen = (seen + NOISE_PX * rng.standard_normal(seen.shape)).astype(np.float32)
    sigmas = np.full(stars, NOISE_PX / focal_px, np.float32)
    own = partial(rays, longer=longer)
    fit = robust_fit(own(seen), reference, sigmas, METER, scale=1.0, excess=2.2)
    verdict = judge_lens(
        seen, reference, sigmas, own, (511.5, 255.5), 1 / focal_px, fit, METER, tolerance
    )
    error = attitude @ dcm(verdict.quaternion, METER).astype(float).T
    turn = [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
    return verdict, np.array(turn) / 2


def is_within(verdict: LensVerdict, error: Reals) -> bool:
    return bool(np.all(np.abs(error) < 4 * np.sqrt(np.diag(verdict.covariance))))


@pytest.mark.parametrize("seed", range(8))
def test_a_lens_as_described_is_believed_as_if_not_judged(seed: int) -> None:
    verdict, error = judged(seed)
    assert verdict.model is None
    assert np.array_equal(verdict.quaternion, judged(seed, tolerance=None)[0].quaternion)
    assert np.hypot(*error[:2]) < np.radians(0.003)
    assert is_within(verdict, error)


@together("stars", [4, 7, 14])
@together("seed", range(8))
def test_a_lens_within_its_tolerance_is_never_refused(seed: int, stars: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = TOLERANCE.point * rng.standard_normal(2)
    cubic = TOLERANCE.radial * rng.standard_normal()
    verdict, error = judged(seed, stars=stars, shift=(x, y), cubic=cubic)
    assert not verdict.is_refused
    assert is_within(verdict, error)


@together("seed", range(8))
@together("linear", [((0.005, 0), (0, 0)), ((0.02, 0), (0, 0)), ((0, 0.02), (0, 0))])
def test_pixels_of_another_shape_are_recognised_and_corrected(
    seed: int, linear: tuple[tuple[float, float], tuple[float, float]]
) -> None:
    verdict, error = judged(seed, linear=linear)
    assert verdict.model is not None
    assert verdict.model.sizes.shape > 0
    assert is_within(verdict, error)
    assert verdict.is_refused or np.hypot(*error[:2]) < np.radians(0.1)


@together("seed", range(8))
@together("px", [5.0, 20.0, 40.0])
def test_a_principal_point_elsewhere_is_recognised(seed: int, px: float) -> None:
    verdict, error = judged(seed, shift=(px * 0.8, -px * 0.6))
    assert verdict.model is not None
    assert verdict.model.is_other == (px > 10)
    assert is_within(verdict, error)
    assert verdict.error_px[3:5] == pytest.approx((px * 0.8, -px * 0.6), abs=2)


@pytest.mark.parametrize("seed", range(8))
def test_a_narrow_field_shows_no_principal_point_and_claims_its_tolerance(seed: int) -> None:
    verdict, error = judged(seed, shift=(4, -3), longer=NARROW)
    tolerated = TOLERANCE.point / (NARROW * FOCAL_PX)
    assert not verdict.is_refused
    assert np.hypot(*error[:2]) == pytest.approx(5 / (NARROW * FOCAL_PX), rel=0.2)
    assert tolerated < np.sqrt(verdict.covariance[0, 0]) < 2 * tolerated
    assert is_within(verdict, error)


def test_a_lens_without_tolerance_is_not_judged() -> None:
    verdict, error = judged(1, shift=(20, 0), tolerance=None)
    assert verdict.model is None
    assert np.hypot(*error[:2]) > 10 * np.sqrt(verdict.covariance[0, 0])


@pytest.mark.parametrize("seed", range(8))
def test_another_lens_with_an_uncertain_boresight_is_refused(seed: int) -> None:
    """Four stars that a shape of 3 % displaces leave the principal point open."""
    verdict, error = judged(seed, stars=4, linear=((0.03, 0), (0.01, 0)))
    is_other = verdict.model is not None and verdict.model.is_other
    moves = verdict.model is not None and verdict.model.moves_boresight
    bound = LARGEST_SIGMA_RAD**2 + verdict.tolerated * (1 if moves else STILL)
    assert verdict.is_refused == (is_other and verdict.across > bound)
    assert verdict.is_refused or is_within(verdict, error)
