"""Claimed uncertainties against errors that were drawn."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.covariance import covariance
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

FIELD_DEG = 20
DRAWS = 600


def _stars(count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Unit vectors (count, 3) spread over the camera's field."""
    edge = np.tan(np.radians(FIELD_DEG))
    points = np.column_stack([rng.uniform(-edge, edge, (count, 2)), np.ones(count)])
    return np.asarray(points / np.linalg.norm(points, axis=1)[:, None], np.float32)


def _share_inside(
    count: int,
    noise: float,
    rng: np.random.Generator,
    *,
    declared: float = 1.0,
    uneven: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shares (3,) of errors inside one claimed sigma, and inside three."""
    ratios = []
    for _ in range(DRAWS):
        body = _stars(count, rng)
        truth = Rotation.random(rng=rng)
        reference = truth.inv().apply(body).astype(np.float32)
        sigmas = noise * (rng.uniform(0.4, 2.5, count) if uneven else np.ones(count))
        moved = body + sigmas[:, None] * rng.standard_normal(body.shape)
        measured = (moved / np.linalg.norm(moved, axis=1)[:, None]).astype(np.float32)
        said = (declared * sigmas).astype(np.float32)
        meter = Meter(CORTEX_M3)
        matrix = dcm(quest(measured, reference, said**-2, meter), meter)
        residuals = np.linalg.norm(measured - reference @ matrix.T, axis=1)
        claimed = covariance(measured, residuals, said, meter)
        error = (Rotation.from_matrix(matrix) * truth.inv()).as_rotvec()
        ratios.append(error / np.sqrt(np.diag(claimed)))
        assert meter.total > 0
    inside = np.abs(ratios)
    return np.mean(inside < 1, axis=0), np.mean(inside < 3, axis=0)


@pytest.mark.parametrize("noise", [3e-5, 1e-3])
@pytest.mark.parametrize("count", [3, 5, 15])
def test_sigmas_hold_per_axis(count: int, noise: float) -> None:
    one, three = _share_inside(count, noise, np.random.default_rng([count, round(1e6 * noise)]))
    assert np.all((one > 0.62) & (one < 0.78)), one
    assert np.all(three > 0.985), three


def test_sigmas_hold_with_uneven_stars() -> None:
    one, three = _share_inside(8, 2e-4, np.random.default_rng(4), uneven=True)
    assert np.all((one > 0.62) & (one < 0.78)), one
    assert np.all(three > 0.985), three


@pytest.mark.parametrize("declared", [0.6, 1.6])
def test_residuals_correct_a_wrong_belief(declared: float) -> None:
    one, three = _share_inside(15, 2e-4, np.random.default_rng(5), declared=declared)
    assert np.all((one > 0.6) & (one < 0.8)), one
    assert np.all(three > 0.985), three


def test_refuses_what_determines_no_attitude() -> None:
    three, nothing = (
        np.repeat(np.array([[0, 0, 1]], np.float32), 3, axis=0),
        np.zeros(3, np.float32),
    )
    sigmas = np.ones(3, np.float32)
    with pytest.raises(AttitudeError, match="2 stars, not 1"):
        covariance(three[:1], nothing[:1], sigmas[:1], Meter(CORTEX_M3))
    with pytest.raises(AttitudeError, match="one direction"):
        covariance(three, nothing, sigmas, Meter(CORTEX_M3))


def test_residuals_beyond_what_chance_gives_count_more() -> None:
    rng = np.random.default_rng(9)
    body = _stars(12, rng)
    sigmas = np.full(12, 1e-4, np.float32)

    def ratio(residual: float) -> float:
        residuals = np.full(12, residual * 1e-4, np.float32)
        plain, more = (
            covariance(body, residuals, sigmas, Meter(CORTEX_M3), excess=excess, beyond=2.0)
            for excess in (1.0, 4.0)
        )
        shares = more / plain
        np.testing.assert_allclose(shares, shares[0, 0], rtol=1e-5)
        return float(shares[0, 0])

    assert ratio(1.4) == 1
    assert 1 < ratio(2.2) < ratio(3) < ratio(10) < 4
    assert ratio(100) == pytest.approx(4, rel=0.01)
