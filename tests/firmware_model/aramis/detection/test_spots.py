"""Spots, and streaks of known length, drawn by sweeping a spot."""

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.regions import find_regions
from cubestack.firmware_model.aramis.detection.spots import (
    StarSpots,
    find_spots,
    smear_px,
    without_tracks,
)
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.pipeline import VERIFIED, detect_locally
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.host.studies.aramis.sky import FIELD, database, meter, picture
from tests.tiers import quick

NOISE = 1.5
Y, X = np.mgrid[: FIELD.rows, : FIELD.columns]


@cache
def noise(seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(0, NOISE, Y.shape)


def spots(
    places: NDArray[np.float64],
    light: float,
    sigma: float = 1.5,
    level: object = 6.0,
    seed: int = 0,
) -> NDArray[np.uint8]:
    image = noise(seed) + level
    for x, y in places:
        part = np.s_[int(y) - 40 : int(y) + 41, int(x) - 40 : int(x) + 41]
        square = (X[part] - x) ** 2 + (Y[part] - y) ** 2
        image[part] += light * np.exp(-square / (2 * sigma**2)) / (2 * np.pi * sigma**2)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def grid(count: int, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(np.arange(350, 950, 60), np.arange(250, 800, 60)), -1)
    chosen = rng.permutation(cells.reshape(-1, 2))[:count]
    return chosen + rng.uniform(-0.5, 0.5, chosen.shape)


def found(image: NDArray[np.uint8]) -> StarList:
    return detect_locally(image, FIELD, VERIFIED.detection, meter())


def apart(stars: StarList, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 2) from the nearest true places."""
    every = stars.centroids[:, None] - places[None]
    nearest = np.linalg.norm(every, axis=2).argmin(axis=1)
    return np.asarray(every[np.arange(len(nearest)), nearest])


@pytest.mark.parametrize("sigma", [1.5, 3.0, 5.0])
@pytest.mark.parametrize("light", [1500.0, 8000.0])
def test_centroid_errors_match_the_reported_sigma(light: float, sigma: float) -> None:
    places = grid(50, 1)
    stars = found(spots(places, light, sigma, level=20.0))
    assert len(stars) >= (20 if (light, sigma) == (1500.0, 5.0) else 49)
    assert stars.sigma_px is not None
    over = apart(stars, places) / stars.sigma_px[:, None]
    # Without neighbours and noise of their own light, bright ones are better than claimed.
    assert (0.05 if light > 5000 else 0.2) < np.sqrt(np.mean(over**2)) < 1.3


@pytest.mark.parametrize("slope", [0.02, 0.06])
def test_background_gradient_shifts_no_centroid(slope: float) -> None:
    places = grid(40, 2)
    stars = found(spots(places, 4000.0, level=10 + slope * X))
    assert len(stars) == 40
    assert np.abs(apart(stars, places).mean(axis=0)).max() < 0.03


def test_brightness_edge_creates_no_star_and_hides_none() -> None:
    """Half of the picture full, the edge fading over some pixels, askew."""
    along = 0.8 * X + 0.6 * Y - 800
    level = 6 + 400 / (1 + np.exp(along / 4))
    places = grid(60, 3)
    free = places[0.8 * places[:, 0] + 0.6 * places[:, 1] > 850]
    stars = found(spots(places, 4000.0, level=level))
    assert np.abs(apart(stars, places)).max() < 1
    assert np.abs(apart(StarList(free, free[:, 0]), stars.centroids)).max() < 1
    assert stars.light is not None
    assert stars.light.saturated > 0.2


def test_hot_pixels_add_no_stars_and_shift_none() -> None:
    places = grid(50, 4)
    image = spots(places, 4000.0)
    hot = np.random.default_rng(5).choice(image.size, 20_000, replace=False)
    image.ravel()[hot] = 255
    stars = found(image)
    assert len(stars) >= 45
    assert np.abs(apart(stars, places)).max() < 1
    assert np.sqrt(np.mean(apart(stars, places) ** 2)) < 0.2
    assert stars.light is not None
    assert stars.light.spikes == pytest.approx(20_000 * FIELD.pixels / image.size, rel=0.1)


def test_moon_with_glare_adds_at_most_one_false_star() -> None:
    """The Moon with its glare."""
    distance = np.hypot(X - 600, Y - 500)
    level = 6 + np.where(distance < 12, 300, 0) + 2000 / (1 + distance**2 / 50)
    places = grid(40, 6)
    stars = found(spots(places, 4000.0, level=level))
    false = np.abs(apart(stars, places)).max(axis=1) > 1
    assert false.sum() <= 1
    assert len(stars) > 30


def test_spot_angle_is_the_angle_of_the_streak() -> None:
    """Turned by less and by more than the diagonal, to either side."""
    angles = np.radians([20, 70, 110, 160])
    ahead = np.linspace(-8, 8, 17)[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], -1)
    middles = np.column_stack([[400, 500, 600, 700], np.full(4, 500)])
    image = spots((middles + ahead).reshape(-1, 2), 400.0)
    streaks = find_spots(image, find_regions(image > 15), NOISE, (20, 400))
    order = np.argsort(streaks.centroids[:, 0])
    np.testing.assert_allclose(streaks.angle[order], angles, atol=0.03)


def test_image_with_too_many_stripes_yields_no_regions() -> None:
    stars = found(np.where(X % 30 < 3, 200, 6).astype(np.uint8))
    assert stars.light is not None
    assert (len(stars), stars.light.rejected, stars.light.widest) == (0, 0, 0)


def test_full_image_has_no_stars() -> None:
    for level in (0, 255):
        assert len(found(np.full(Y.shape, level, np.uint8))) == 0


def swept(
    length: float, angle_deg: float, light: float, count: int = 12, background: Any = 0
) -> NDArray[np.uint8]:
    """Spots that move by `length`, of `light` grey levels each."""
    steps, angle = max(1, round(2 * length)), np.radians(angle_deg)
    along = length * ((np.arange(steps) + 0.5) / steps - 0.5)
    middles = np.array([(300 + 180 * (n % 4), 200 + 180 * (n // 4)) for n in range(count)])
    places = middles[:, None] + along[:, None] * [np.cos(angle), np.sin(angle)]
    return spots(places.reshape(-1, 2), light / steps, level=6 + background, seed=3)


@pytest.mark.parametrize("angle_deg", [0, 30, 90, 135])
@pytest.mark.parametrize("length", [0.0, 6.0, 20.0])
def test_smear_length_of_bright_streaks_is_measured(length: float, angle_deg: float) -> None:
    image = swept(length, angle_deg, light=4000, count=4)
    found_px = smear_px(image, find_regions(image > 12), 6)
    assert found_px == pytest.approx(length, abs=1.5)


@pytest.mark.parametrize(
    ("length", "angle_deg"), quick(product([8.0, 20.0, 60.0], [0, 40, 90, 160]), 5)
)
def test_parallel_streaks_are_measured_as_motion(length: float, angle_deg: float) -> None:
    stars = found(swept(length, angle_deg, light=200 * length))
    assert stars.smear_px == pytest.approx(length, rel=0.2)
    assert len(stars) == 12


def test_streaks_around_the_boresight_are_motion() -> None:
    places = np.array([[300, 0], [0, 300], [-300, 0], [0, -300], [200, 200]], np.float32)
    spots = long_spots(places + FIELD.centre, np.arctan2(places[:, 1], places[:, 0]) + np.pi / 2)
    kept, smear = without_tracks(spots, FIELD)
    assert (len(kept), smear) == (5, pytest.approx(12))


@pytest.mark.parametrize(("count", "length"), [(3, 12), (2, 0)])
def test_three_parallel_streaks_are_motion_and_two_are_not(count: int, length: float) -> None:
    places = FIELD.centre + np.array([[100, 50], [-200, 80], [30, -250]][:count])
    kept, smear = without_tracks(long_spots(places, np.full(count, 0.7)), FIELD)
    assert (len(kept), smear) == (count if length else 0, pytest.approx(length))


def test_tracks_in_random_directions_are_discarded() -> None:
    rng = np.random.default_rng(1)
    spots = long_spots(FIELD.centre + rng.uniform(-300, 300, (20, 2)), rng.uniform(0, np.pi, 20))
    kept, smear = without_tracks(spots, FIELD)
    assert (len(kept), smear) == (0, 0)


def test_unsmeared_stars_have_no_measured_smear() -> None:
    """Nor are noise alone, bright stars in rows and columns, a slope, or a glow."""
    y, x = np.mgrid[: FIELD.rows, : FIELD.columns]
    glow = 30 * np.exp(-((x - 400) ** 2 + (y - 200) ** 2) / (2 * 300.0**2))
    for light, background in ((0, 0), (8000, 0), (0, 0.05 * x), (800, 0.05 * x), (800, glow)):
        stars = found(swept(0, 0, light, background=background))
        assert stars.smear_px == 0
        assert len(stars) == (12 if light else 0)


def test_smear_without_regions_is_0() -> None:
    image = np.zeros((FIELD.rows, FIELD.columns), np.uint8)
    assert smear_px(image, find_regions(image > 0), 0) == 0  # type: ignore[arg-type]


def long_spots(places: NDArray[Any], angles: NDArray[Any]) -> StarSpots:
    """Streaks of 12 px."""
    ones, places = np.ones(len(places), np.float32), places.astype(np.float32)
    angles = (angles % np.pi).astype(np.float32)
    return StarSpots(places, 100 * ones, ones, 12 * ones, angles, 20 * ones, 0, 0)


def test_smear_is_the_reason_when_there_is_no_attitude() -> None:
    made = picture(np.random.default_rng(1), FIELD)
    few = made.stars.centroids[:2], made.stars.brightness[:2]
    for smear, reason in ((9.0, Reason.SMEAR), (2.0, Reason.TOO_FEW_STARS)):
        found = identify(StarList(*few, smear), FIELD, VERIFIED.profile, database(), meter())
        assert (found.outcome, found.reason) == (MeasurementOutcome.NONE, reason)
