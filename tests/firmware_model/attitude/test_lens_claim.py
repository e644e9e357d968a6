"""Claims about the attitude with lenses that are not as described, few stars, and none to check."""

import numpy as np
import pytest
from scipy.special import ndtr, stdtr

from cubestack.firmware_model.attitude.lens_claim import _tails
from tests.tiers import quick

from .test_lens_doubt import FOCAL_PX, NARROW, TOLERANCE, is_within, judged

SKIES = range(10)


def shape(seed: int, percent: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Pixels wider than high, or skewed."""
    wide = percent / 100 * (1 if seed % 4 < 2 else -1)
    return ((wide, 0), (0, 0)) if seed % 2 else ((0, wide), (0, 0))


def shift(seed: int, px: float) -> tuple[float, float]:
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    return px * np.cos(angle), px * np.sin(angle)


@pytest.mark.parametrize("stars", quick([4, 5, 9, 14], 2))
@pytest.mark.parametrize("percent", quick([2.0, 0.5, 5.0], 1))
def test_no_shape_of_pixels_is_believed_outside_of_the_claim(stars: int, percent: float) -> None:
    for seed in SKIES:
        verdict, error = judged(seed, stars=stars, linear=shape(seed, percent))
        assert verdict.is_refused or is_within(verdict, error), seed


@pytest.mark.parametrize("longer", quick([1.0, 2.5, NARROW, 1.5], 2))
@pytest.mark.parametrize("stars", quick([4, 5, 9, 14], 2))
@pytest.mark.parametrize("tolerances", quick([4.0, 2.0, 1.0], 1))
def test_no_principal_point_is_believed_outside_of_the_claim(
    longer: float, stars: int, tolerances: float
) -> None:
    """In a narrow field no residual shows it, so that the tolerance must cover it."""
    for seed in SKIES:
        moved = shift(seed, tolerances * TOLERANCE.point)
        verdict, error = judged(seed, stars=stars, shift=moved, longer=longer)
        assert verdict.is_refused or is_within(verdict, error), seed


@pytest.mark.parametrize("stars", [5, 9, 14])
def test_a_claim_is_never_narrower_than_the_tolerance_leaves(stars: int) -> None:
    tolerated = TOLERANCE.point / (NARROW * FOCAL_PX)
    for seed in SKIES:
        verdict, _ = judged(seed, stars=stars, longer=NARROW)
        assert np.all(np.sqrt(np.diag(verdict.covariance)[:2]) > 0.9 * tolerated)


def test_many_stars_of_a_wide_field_claim_less_than_the_tolerance() -> None:
    claims = [np.sqrt(judged(seed, stars=25)[0].covariance[0, 0]) for seed in SKIES]
    assert np.median(claims) < TOLERANCE.point / FOCAL_PX / 3


@pytest.mark.parametrize("degrees", [4, 7, 12, 30])
def test_four_wider_sigmas_are_exceeded_as_rarely_as_of_a_normal_distribution(degrees: int) -> None:
    far = 4 * np.sqrt(_tails(degrees))
    assert stdtr(degrees, -far) == pytest.approx(ndtr(-4), rel=0.5)
    assert stdtr(degrees, -far) < 1.2 * ndtr(-4)
