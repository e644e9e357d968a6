"""The rate from two images, beside rotations of scipy."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.gyro import (
    LARGEST_RATE_DEG_S,
    BodyRate,
    TimedStars,
    rate_between,
)

from ..operations import as_on_record

SIGMA = 1e-4
MARGIN = 1e-3
SOLID_ANGLE_SR = 0.45
ROLL_OUT_S = 0.07


def field(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3) in a field of 54 x 28 deg."""
    plane = np.column_stack([rng.uniform([-0.5, -0.25], [0.5, 0.25], (count, 2)), np.ones(count)])
    return np.asarray(plane / np.linalg.norm(plane, axis=1, keepdims=True))


def moved(
    stars: NDArray[np.float64], rate_rad_s: NDArray[np.float64], times_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Stars (n, 3), each in the axes of a camera that turns, at its own time (n,)."""
    turns = Rotation.from_rotvec(np.outer(times_s, -rate_rad_s))
    return np.asarray(turns.apply(stars))


def late(stars: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rolling shutter exposes what is lower in the image later."""
    return np.asarray(ROLL_OUT_S * stars[:, 1] / stars[:, 2])


def timed(stars: NDArray[np.float64], times_s: NDArray[np.float64]) -> TimedStars:
    return TimedStars(stars.astype(np.float32), times_s.astype(np.float32))


def measured(before: TimedStars, now: TimedStars, apart_s: float = 1.0) -> BodyRate | None:
    sigmas = np.full(len(now.directions), SIGMA, np.float32)
    return rate_between(
        before,
        now,
        sigmas,
        apart_s,
        Meter(CORTEX_M3),
        margin_rad=MARGIN,
        solid_angle_sr=SOLID_ANGLE_SR,
    )


def rate_of(rng: np.random.Generator, deg_s: float) -> NDArray[np.float64]:
    axis = rng.standard_normal(3)
    return np.asarray(np.radians(deg_s) * axis / np.linalg.norm(axis))


def images(
    rng: np.random.Generator,
    rate_rad_s: NDArray[np.float64],
    *,
    stars: int = 9,
    false: int = 0,
    noise: float = 0.0,
    apart_s: float = 1.0,
) -> tuple[TimedStars, TimedStars]:
    """Two images of turning stars in different order, each with ``false`` ones of its own."""
    sky, taken = field(rng, stars), []
    for start_s in (0.0, apart_s):
        rows = late(moved(sky, rate_rad_s, np.full(stars, start_s)))
        seen = moved(sky, rate_rad_s, start_s + rows)
        seen = np.concatenate([seen + noise * rng.standard_normal(seen.shape), field(rng, false)])
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        order = rng.permutation(len(seen))
        taken.append(timed(seen[order], np.concatenate([rows, np.zeros(false)])[order]))
    return taken[0], taken[1]


@pytest.mark.parametrize("deg_s", [0.0, 0.01, 0.3, 1.0, 1.9])
@pytest.mark.parametrize("apart_s", [0.5, 1.0, 2.0])
def test_rates_without_noise_are_those_of_the_rotation(deg_s: float, apart_s: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        truth = rate_of(rng, deg_s)
        rate = measured(*images(rng, truth, apart_s=apart_s), apart_s)
        assert rate is not None
        assert rate.matched == 9
        np.testing.assert_allclose(rate.rate_rad_s, truth, atol=2e-6 + 2e-5 * np.radians(deg_s))


def test_times_of_rows_count() -> None:
    """At 1.5 deg/s down the image, 7 % of a second an image apart: without the rows' times the
    rate is wrong by much more than with them."""
    rng = np.random.default_rng(2)
    truth = np.radians([1.5, 0.0, 0.0])
    before, now = images(rng, truth)
    at_once = [TimedStars(one.directions, np.zeros_like(one.late_s)) for one in (before, now)]
    exact, wrong = measured(before, now), measured(at_once[0], at_once[1])
    assert exact is not None
    assert wrong is not None
    errors = [np.abs(rate.rate_rad_s - truth).max() for rate in (exact, wrong)]
    assert errors[0] < 2e-6
    assert errors[1] > 20 * errors[0]


def test_false_stars_are_left_out() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        truth = rate_of(rng, 0.5)
        rate = measured(*images(rng, truth, stars=6, false=8))
        assert rate is not None
        np.testing.assert_allclose(rate.rate_rad_s, truth, atol=2e-4)


def test_claimed_sigmas_are_those_of_the_errors() -> None:
    rng = np.random.default_rng(4)
    ratios, sigmas = [], []
    for _ in range(200):
        truth = rate_of(rng, 0.3)
        rate = measured(*images(rng, truth, noise=SIGMA))
        assert rate is not None
        sigmas.append(np.sqrt(np.diag(rate.covariance)))
        ratios.append((rate.rate_rad_s - truth) / sigmas[-1])
    spread = np.sqrt(np.mean(np.square(ratios), axis=0))
    assert np.all((spread > 0.7) & (spread < 1.25)), spread
    # Two images with 9 stars each: sqrt(2 / 9) of a star's error across, more about the boresight.
    assert np.mean(sigmas, axis=0)[:2] == pytest.approx(SIGMA * np.sqrt(2 / 9), rel=0.3)


def test_half_the_time_doubles_the_claimed_sigma() -> None:
    both = []
    for apart_s in (0.5, 1.0):
        rng = np.random.default_rng(5)
        both.append(measured(*images(rng, np.zeros(3), apart_s=apart_s), apart_s))
    short, long = both
    assert short is not None
    assert long is not None
    assert np.diag(short.covariance) == pytest.approx(4 * np.diag(long.covariance), rel=1e-3)


def test_images_of_different_skies_have_no_rate() -> None:
    rng = np.random.default_rng(6)
    for count in (2, 5, 9, 20):
        for _ in range(100):
            skies = [field(rng, number) for number in (min(count, 9), count)]
            assert measured(*(timed(sky, late(sky)) for sky in skies)) is None


def test_too_fast_a_turn_has_no_rate() -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        truth = np.radians([1.5 * LARGEST_RATE_DEG_S, 0, 0])
        assert measured(*images(rng, truth)) is None


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_stars_have_no_rate(count: int) -> None:
    rng = np.random.default_rng(8)
    assert measured(*images(rng, np.zeros(3), stars=count)) is None


def test_two_stars_at_one_place_have_no_rate() -> None:
    star = np.array([[0.0, 0.0, 1.0], [0.0, 1e-4, 1.0]])
    assert measured(timed(star, late(star)), timed(star, late(star))) is None


@pytest.mark.parametrize("count", [2, 9])
def test_gyro_charges_the_recorded_operations(count: int) -> None:
    rng, meter = np.random.default_rng(9), Meter(CORTEX_M3)
    before, now = images(rng, rate_of(rng, 0.3), stars=count, noise=SIGMA)
    sigmas = np.full(count, SIGMA, np.float32)
    how = {"margin_rad": MARGIN, "solid_angle_sr": SOLID_ANGLE_SR}
    rate = rate_between(before, now, sigmas, 1.0, meter, **how)
    assert rate is not None
    as_on_record(f"gyro: {count} stars", meter)
