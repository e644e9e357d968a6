"""Centroids of single windows: as good as can be, and honest about it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import spots

from .pictures import spots as drawn


def windows(
    rng: np.random.Generator, count: int, light: float, noise: float, sigma: float = 0.9
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Windows of stars of so much light in noise, in 1/16 DN, and the stars' places in them."""
    places = rng.uniform(-0.5, 0.5, (count, 2))
    cut = np.s_[50 - spots.HALF : 51 + spots.HALF]
    values = [drawn(place[None] + 50, np.array([light]), sigma)[cut, cut] for place in places]
    noisy = np.stack(values) + rng.normal(0, noise, (count, 9, 9)) if noise else np.stack(values)
    return np.rint(16 * noisy).astype(np.int64), places


def found(signal: NDArray[np.int64], noise: float, sigma: float) -> spots.Centroids:
    count = len(signal)
    noises = np.full(count, max(round(16 * noise), 5))
    start, saturated = np.zeros((count, 2)), np.zeros(count, np.bool_)
    return spots.centre(signal, start, saturated, noises, sigma)


@pytest.mark.parametrize("sigma", [0.8, 0.9, 1.4])
def test_a_spot_without_noise_is_found_to_a_hundredth_of_a_pixel(sigma: float) -> None:
    signal, places = windows(np.random.default_rng(1), 100, 1000.0, 0.0, sigma)
    error = found(signal, 0, np.hypot(sigma, 0.29)).places - places
    assert np.abs(error).max() < 0.01
    assert np.abs(error).mean() < 0.005


@pytest.mark.slow
@pytest.mark.parametrize(("light", "noise"), [(300.0, 1.0), (300.0, 4.0), (1000.0, 4.0)])
def test_reported_centroid_error_matches_the_true_error(light: float, noise: float) -> None:
    signal, places = windows(np.random.default_rng(2), 800, light, noise)
    measured = found(signal, noise, 0.945)
    pulls = (measured.places - places) / measured.errors[:, None]
    assert np.percentile(np.abs(pulls), 68.3) == pytest.approx(1, abs=0.25)
    assert np.abs(pulls.mean(axis=0)).max() < 0.1


def test_hot_pixel_shifts_a_centroid_less_than_its_reported_error() -> None:
    signal, places = windows(np.random.default_rng(3), 300, 500.0, 0.3)
    signal[:, spots.HALF + 1, spots.HALF - 2] += 16 * 60
    measured = found(signal, 0.3, 0.945)
    error = np.abs(measured.places - places).max(axis=1)
    plain = (signal.sum(axis=1) @ np.arange(-4, 5)) / signal.sum(axis=(1, 2)) - places[:, 0]
    assert np.median(error) < 0.03 < np.abs(np.median(plain))
    assert np.mean(error < 3 * measured.errors) > 0.95


@pytest.mark.parametrize("sigma", [0.6, 0.9, 1.4])
def test_spot_width_is_measured(sigma: float) -> None:
    rng = np.random.default_rng(4)
    signal, _ = windows(rng, 20, 1500.0, 0.3, sigma)
    few = np.zeros(20, np.bool_)
    star, usual = spots.shapes(signal, np.zeros((20, 2)), few, np.full(20, 5))
    assert usual == pytest.approx(np.hypot(sigma, 0.29), rel=0.05)
    assert np.all(star)


def test_spots_of_unusual_width_are_rejected() -> None:
    rng = np.random.default_rng(5)
    kinds = [windows(rng, 12, 900.0, 0.3), windows(rng, 5, 500.0, 0.3, 0.4)]
    kinds.append(windows(rng, 3, 600.0, 0.3, 2.2))
    signal = np.concatenate([kind[0] for kind in kinds])
    star, usual = spots.shapes(signal, np.zeros((20, 2)), np.zeros(20, np.bool_), np.full(20, 5))
    assert usual == pytest.approx(0.945, rel=0.05)
    assert star.tolist() == [True] * 12 + [False] * 8


def test_single_bright_pixel_is_rejected_as_too_sharp() -> None:
    signal, _ = windows(np.random.default_rng(6), 5, 300.0, 0.3)
    lone = np.zeros((1, 9, 9), np.int64)
    lone[0, 4, 4], lone[0, 4, 5] = 3000, 300
    noises = np.full(6, 5)
    assert spots.too_sharp(np.concatenate([signal, lone]), noises).tolist() == [False] * 5 + [True]
