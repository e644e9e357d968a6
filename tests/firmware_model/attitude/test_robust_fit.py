"""Attitudes from stars of which some are displaced, through lenses of another focal length;
and claimed uncertainties against errors that were drawn.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.covariance import covariance
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.attitude.robust_fit import AttitudeFit, robust_fit
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from tests.tiers import quick

Floats = NDArray[np.float32]
SIGMA = 2e-5
DRAWS = 300
METER = Meter(CORTEX_M3)


def unit(vectors: NDArray[np.floating]) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None], np.float32)


def seen(
    rng: np.random.Generator, count: int = 12, side: float = 0.0, sigmas: ArrayLike = SIGMA
) -> tuple[Floats, Floats, Rotation]:
    """Measured and catalogue vectors (count, 3), and the attitude; ``side`` moves the stars off."""
    points = np.column_stack([rng.uniform(-0.4, 0.4, (count, 2)), np.ones(count)])
    points[:, 0] += side
    body, truth = unit(points), Rotation.random(rng=rng)
    noisy = unit(body + np.reshape(sigmas, (-1, 1)) * rng.standard_normal(body.shape))
    return noisy, np.asarray(truth.inv().apply(body), np.float32), truth


def fitted(measured: Floats, reference: Floats, scale: float = 1.0) -> AttitudeFit:
    sigmas = np.full(len(measured), SIGMA, np.float32)
    return robust_fit(measured, reference, sigmas, METER, scale=scale, excess=1.0)


def error(quaternion: Floats, truth: Rotation) -> NDArray[np.float64]:
    return np.asarray((Rotation.from_matrix(dcm(quaternion, METER)) * truth.inv()).as_rotvec())


def hold(one: ArrayLike, three: ArrayLike, low: float = 0.62, high: float = 0.8) -> None:
    """Shares inside one claimed sigma and inside three are those of a normal distribution."""
    assert np.all((low < np.asarray(one)) & (np.asarray(one) < high)), one
    assert np.all(np.asarray(three) > 0.985), three


def shares(draw: Callable[[np.random.Generator], tuple[Floats, Floats, Rotation]]) -> list[float]:
    """Of errors inside 1 and 3 claimed sigmas."""
    rng, ratios = np.random.default_rng(1), []
    for _ in range(DRAWS):
        measured, reference, truth = draw(rng)
        fit = fitted(measured, reference)
        ratios.append(error(fit.quaternion, truth) / np.sqrt(np.diag(fit.covariance)))
    return [float(np.mean(np.abs(ratios) < sigmas)) for sigmas in (1, 3)]


@pytest.mark.parametrize("displaced", [0, 1, 3])
def test_displaced_stars_do_not_disturb_the_robust_fit(displaced: int) -> None:
    rng, robust, plain = np.random.default_rng(displaced), [], []
    for _ in range(60):
        measured, reference, truth = seen(rng)
        measured[:displaced] = unit(
            measured[:displaced] + rng.normal(0, 40 * SIGMA, (displaced, 3))
        )
        robust.append(error(fitted(measured, reference).quaternion, truth))
        even = np.ones(len(measured), np.float32)
        plain.append(error(quest(measured, reference, even, METER), truth))
    ratio = np.sqrt(np.mean(np.square(robust)) / np.mean(np.square(plain)))
    assert ratio < (1.15 if displaced == 0 else 0.4)


def test_sigmas_hold_with_displaced_stars() -> None:
    def draw(rng: np.random.Generator) -> tuple[Floats, Floats, Rotation]:
        measured, reference, truth = seen(rng)
        measured[:1] = unit(measured[:1] + rng.normal(0, 40 * SIGMA, (1, 3)))
        return measured, reference, truth

    hold(*shares(draw))


@pytest.mark.parametrize("factor", quick([0.99, 0.999, 1.003, 1.0, 1.02], 1))
@pytest.mark.parametrize("side", quick([0.3, 0.0], 1))
def test_robust_fit_estimates_a_focal_length_error_only_if_present(
    factor: float, side: float
) -> None:
    def draw(rng: np.random.Generator) -> tuple[Floats, Floats, Rotation]:
        measured, reference, truth = seen(rng, side=side)
        return scaled(measured, factor, METER), reference, truth

    measured, reference, _ = draw(np.random.default_rng(2))
    scale = fitted(measured, reference).scale
    assert scale == pytest.approx(factor, abs=2e-4)
    assert factor != 1 or scale == 1
    hold(*shares(draw))


def test_a_first_guess_of_the_focal_length_is_refined() -> None:
    measured, reference, truth = seen(np.random.default_rng(3))
    fit = fitted(scaled(measured, 1.03, METER), reference, scale=1.027)
    assert fit.scale == pytest.approx(1.03, abs=2e-4)
    assert np.linalg.norm(error(fit.quaternion, truth)) < 5e-5


def test_robust_fit_rejects_no_star_when_sigma_is_underestimated() -> None:
    """Residuals five times as large as believed are taken for the belief's fault."""
    rng, apart = np.random.default_rng(1), []
    for _ in range(40):
        measured, reference, truth = seen(rng, count=15)
        measured[:1] = unit(measured[:1] + rng.normal(0, 8 * SIGMA, (1, 3)))
        right, small = (
            robust_fit(
                measured, reference, np.full(15, believed, np.float32), METER, scale=1.0, excess=1.0
            )
            for believed in (SIGMA, SIGMA / 5)
        )
        apart.append(error(right.quaternion, truth) - error(small.quaternion, truth))
    assert np.sqrt(np.mean(np.square(apart))) < 0.08 * SIGMA


def axis_shares(
    count: int, noise: float, seed: Any, declared: float = 1.0, uneven: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shares (3,) of errors inside one claimed sigma, and inside three."""
    rng, ratios = np.random.default_rng(seed), []
    for _ in range(2 * DRAWS):
        sigmas = noise * (rng.uniform(0.4, 2.5, count) if uneven else np.ones(count))
        measured, reference, truth = seen(rng, count, sigmas=sigmas)
        said = (declared * sigmas).astype(np.float32)
        quaternion = quest(measured, reference, said**-2, METER)
        residuals = np.linalg.norm(measured - reference @ dcm(quaternion, METER).T, axis=1)
        claimed = covariance(measured, residuals, said, METER)
        ratios.append(error(quaternion, truth) / np.sqrt(np.diag(claimed)))
    inside = np.abs(ratios)
    return np.mean(inside < 1, axis=0), np.mean(inside < 3, axis=0)


@pytest.mark.parametrize("noise", quick([3e-5, 1e-3], 1))
@pytest.mark.parametrize("count", quick([3, 5, 15], 1))
def test_sigmas_hold_per_axis(count: int, noise: float) -> None:
    hold(*axis_shares(count, noise, [count, round(1e6 * noise)]), high=0.78)


def test_sigmas_hold_with_uneven_stars() -> None:
    hold(*axis_shares(8, 2e-4, 4, uneven=True), high=0.78)


@pytest.mark.parametrize("declared", quick([0.6, 1.6], 1))
def test_covariance_adapts_to_residuals_when_sigma_is_misstated(declared: float) -> None:
    hold(*axis_shares(15, 2e-4, 5, declared=declared), low=0.6)


def test_covariance_refuses_vectors_that_determine_no_attitude() -> None:
    three, nothing = np.array([[0, 0, 1]] * 3, np.float32), np.zeros(3, np.float32)
    sigmas = np.ones(3, np.float32)
    with pytest.raises(AttitudeError, match="2 stars, not 1"):
        covariance(three[:1], nothing[:1], sigmas[:1], METER)
    with pytest.raises(AttitudeError, match="one direction"):
        covariance(three, nothing, sigmas, METER)


def test_residuals_above_expectation_enlarge_the_covariance() -> None:
    rng = np.random.default_rng(9)
    body = seen(rng)[0]
    sigmas = np.full(12, 1e-4, np.float32)

    def ratio(residual: float) -> float:
        residuals = np.full(12, residual * 1e-4, np.float32)
        plain, more = (
            covariance(body, residuals, sigmas, METER, excess=excess, beyond=2.0)
            for excess in (1.0, 4.0)
        )
        shares = more / plain
        np.testing.assert_allclose(shares, shares[0, 0], rtol=1e-5)
        return float(shares[0, 0])

    assert ratio(1.4) == 1
    assert 1 < ratio(2.2) < ratio(3) < ratio(10) < 4
    assert ratio(100) == pytest.approx(4, rel=0.01)
